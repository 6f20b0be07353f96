"""The pane with the question on the robot's face, which operators can answer, too."""

from __future__ import annotations

from functools import partial

from nicegui import ui

from codebotler.core.terminal import shortened
from codebotler.core.text.words import counted
from codebotler.robots.face import Face, FaceQuestion
from codebotler.web.frame import Button, DrawnBox, PlainText

_MAX_OPTIONS, _MAX_OPTION_CHARACTERS = 50, 200


class QuestionPane:
    """Shows the robot's question, and the number of screens that show the face."""

    def __init__(self, face: Face) -> None:
        self._face = face
        self._screens = PlainText("p", "", "quiet")
        self._box = DrawnBox("asking", self._draw)
        self._box.props('role=group aria-label="What the robot asks"')

    def show(self, *, is_over: bool) -> None:
        """Show the current question. During a mission, recommend opening the face if no screen shows it."""
        screens = self._face.screens
        shown = f"The robot's face is open on {counted(screens, 'screen')}."
        nobody = "" if is_over else "Open the robot's face so people can see what it says and asks."
        self._screens.show_text(shown if screens else nobody)
        self._screens.classes(add="" if screens else "unsure", remove="unsure" if screens else "")
        self._box.show(self._face.shown.question)

    def _draw(self, question: FaceQuestion) -> None:
        PlainText(
            "p", f"Waiting for an answer from {shortened(question.person, _MAX_OPTION_CHARACTERS)}:", "quiet"
        )
        PlainText("p", shortened(question.text), "question")
        with ui.element("div").classes("word"):
            for position, option in enumerate(question.options[:_MAX_OPTIONS]):
                words = shortened(option, _MAX_OPTION_CHARACTERS).strip() or "(blank)"
                Button(words, partial(self._face.answer, question.number, position), "plain")
