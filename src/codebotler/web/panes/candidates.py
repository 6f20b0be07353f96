"""The pane that asks which of several behaviours a person means."""

from __future__ import annotations

import asyncio

from nicegui import ui

from codebotler.candidates.question import CandidateOption, ClarifyingAnswer, ClarifyingQuestion
from codebotler.core.terminal import shortened
from codebotler.missions.display.view import SessionView
from codebotler.missions.display.wording import capitalize
from codebotler.web.console import Console
from codebotler.web.frame import Button, DrawnBox, PlainText, scroll_up, warn
from codebotler.web.storyboard import draw_scene, scenes

_MAX_DIFFERENCE, _MAX_SENTENCE, _MAX_NEEDED_STEPS = 400, 500, 6


class CandidatesPane:
    """Asks which of several behaviours a person means, and shows a storyboard for each, side by side."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._more: ui.textarea | None = None  # what should be different, if there is a second question
        self._box = DrawnBox("which", self._draw)

    def show(self, view: SessionView) -> None:
        """Show the question that the mission asks, or hide the pane if it asks none."""
        self._box.show(view.question if view.waits_for_answer else None)

    def _draw(self, question: ClarifyingQuestion) -> None:
        PlainText("h3", "Which did you mean?")
        PlainText("p", question.legend, "world")
        with ui.element("div").classes("cards"):
            for number, option in enumerate(question.options):
                with ui.element("article").classes("card"):
                    self._draw_option(option, number)
        PlainText("p", question.left_out, "quiet")
        self._more = None
        if question.why_last:
            PlainText("p", f'{capitalize(question.why_last)}, so "None of these" ends the mission.', "quiet")
        else:
            label = "If none of these: what should be different?"
            self._more = ui.textarea(label).props(f"outlined autogrow rows=1 maxlength={_MAX_SENTENCE}")
        with ui.element("div").classes("others"):
            Button("None of these", self._reject, "plain")
            Button("You decide (the first one)", lambda: self._answer("decide"), "plain")

    def _draw_option(self, option: CandidateOption, number: int) -> None:
        PlainText("p", f"{number + 1}. {shortened(option.difference, _MAX_DIFFERENCE)}", "difference")
        PlainText("small", option.share, "quiet")
        if option.steps:
            with ui.element("ol").classes("scenes").props('aria-label="Room by room"'):
                needed = sorted(option.own)[:_MAX_NEEDED_STEPS]
                for scene in scenes(option.steps, option.steps[0]["place"], needed):
                    draw_scene(scene, option.own)
        else:
            PlainText("p", "The robot does nothing.")
        button = Button("This one", lambda: self._answer(number), "go")
        button.props(f'aria-label="This one: option {number + 1}"')

    async def _reject(self) -> None:
        """Answer `none`, with a sentence if there is a field for one."""
        if self._more is not None and not self._words:
            warn("Say what should be different, or stop the mission.")
        else:
            await self._answer("none")

    @property
    def _words(self) -> str:
        return "" if self._more is None else str(self._more.value or "").strip()

    async def _answer(self, answer: ClarifyingAnswer) -> None:
        """Answer with the words that were typed, which count only for `none`, and are refused otherwise."""
        session, more = self._console.session, self._words
        if session is not None:
            scroll_up()  # before the answer, which removes the question from the page
            await asyncio.to_thread(session.answer, self._box.content, answer, more)
