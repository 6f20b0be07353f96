"""What the robot asks on its face just now, so that an operator sees it, and can answer as well."""

from __future__ import annotations

from nicegui import ui

from codebotler.core.terminal import shortened
from codebotler.robots.face import AnswerError, Face, Question
from codebotler.web.elements import Press, Words, warn

MOST_OPTIONS, MOST_TEXT = 50, 200


class Asking:
    """Shows the question that waits for an answer, and whether anybody can see it.

    Args:
        face: on which it is asked.
    """

    def __init__(self, face: Face) -> None:
        self._face = face
        self._drawn: Question | None = None
        self._screens = Words("p", "", "quiet")
        self._box = ui.element("div").classes("asking").props('role=group aria-label="What the robot asks"')

    def show(self, *, is_over: bool) -> None:
        """Show it as it is now.

        Args:
            is_over: whether no mission is at hand.
        """
        screens = self._face.screens
        shown = f"{screens} {'face shows' if screens == 1 else 'faces show'} what the robot says."
        nobody = "" if is_over else "No face is open, so that nobody sees what the robot says and asks."
        self._screens.say(shown if screens else nobody)
        self._screens.classes(add="" if screens else "unsure", remove="unsure" if screens else "")
        question = self._face.shown.question
        self._box.set_visibility(question is not None)
        if question is not self._drawn:
            self._drawn = question
            self._box.clear()
            if question is not None:
                with self._box:
                    self._draw(question)

    def _draw(self, question: Question) -> None:
        Words("p", f"Waits for an answer by {shortened(question.person, MOST_TEXT)}:", "quiet")
        Words("p", shortened(question.text), "question")
        with ui.element("div").classes("word"):
            for position, option in enumerate(question.options[:MOST_OPTIONS]):
                words = shortened(option, MOST_TEXT).strip() or "(without words)"
                Press(words, lambda at=position: self._answer(question, at), "plain")

    def _answer(self, question: Question, position: int) -> None:
        try:
            self._face.answer(question.number, position)
        except AnswerError as error:
            warn(error.sentence)
