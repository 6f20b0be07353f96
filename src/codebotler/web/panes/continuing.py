"""The parts of the page that offer to continue a mission, and that show what was done before."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial

from nicegui import html, ui

from codebotler.core.terminal import note, shortened
from codebotler.core.text.words import counted
from codebotler.core.trace import Event
from codebotler.missions.display.view import SessionView
from codebotler.missions.display.wording import capitalize
from codebotler.missions.mission import MissionError
from codebotler.missions.storage.log import MissionState, MissionSummary
from codebotler.missions.storage.past import MissionPast
from codebotler.web.console import Console
from codebotler.web.frame import Button, PlainText, scroll_up

MAX_OPEN_STEPS = 12
_MAX_STEPS, _MAX_STEP_CHARACTERS, _MAX_ANSWERS = 500, 300, 8
EARLY_ENDS = frozenset({MissionState.FAILED, MissionState.STOPPED, MissionState.INTERRUPTED})


class ContinueButton(Button):
    """A button to continue a mission that ended early, after asking about any step that may have happened.

    `model` returns the model to write a program for the remaining steps, or "" for the mission's own model.
    """

    def __init__(self, console: Console, mission: str = "", model: Callable[[], str] = str) -> None:
        super().__init__("Continue", self._continue, "primary")
        self._console, self._mission, self._model = console, mission, model

    def show(self, view: SessionView) -> None:
        """Show the button if this mission or, if not, an earlier one can be continued. Otherwise, hide it."""
        is_other = not (has_rest(view) or view.progress.has_begun or view.past)
        aside = self._console.unfinished if is_other else ""
        self._mission = aside or view.id or ("" if view.past is None else view.past.mission)
        own = "Continue" if view.progress.has_begun or view.past is None else "Ask for the rest again"
        self.text = "Continue the mission before instead" if aside else own
        self.classes(add="plain" if aside else "primary", remove="primary plain")
        self.set_visibility(has_rest(view) or bool(aside))

    async def _continue(self) -> None:
        console = self._console
        past = await asyncio.to_thread(console.past_of, self._mission)
        if past.unsure is None:
            self._begin(past)
            return
        evidence = await asyncio.to_thread(console.ask_evidence, past, note)
        if not self.is_deleted:
            with self:
                self._ask(past, evidence)

    def _ask(self, past: MissionPast, evidence: list[str]) -> None:
        """Ask a person whether the unsure step happened, beside what the log and the robot say."""
        before = self._console.session

        def answer(*, happened: bool, answer: str = "") -> None:
            dialog.close()
            if self._console.session is not before:
                raise MissionError("another mission began in the meantime, so this one was not continued")
            self._begin(past.resolve(happened=happened, answer=answer))

        with ui.dialog() as dialog, ui.card().classes("pane"):
            PlainText("h3", "Did this happen?")
            PlainText("p", f"{capitalize(past.unsure_step_text)}.")
            for sentence in evidence:
                PlainText("p", sentence, "quiet")
            with ui.element("div").classes("word"):
                for one in past.answers[:_MAX_ANSWERS]:
                    words = f'It happened: "{shortened(one, _MAX_STEP_CHARACTERS)}"'
                    Button(words, partial(answer, happened=True, answer=one), "plain")
                plainly = "It happened; nobody knows the answer" if past.answers else "It happened"
                Button(plainly, partial(answer, happened=True), "plain")
                Button("It did not happen", partial(answer, happened=False), "plain")
                Button("Cancel", dialog.close, "plain")
        dialog.props('aria-label="Did this happen?"').on("hide", dialog.delete)
        dialog.open()

    def _begin(self, past: MissionPast) -> None:
        self._console.begin(self._console.rest_of(past, model=self._model()))
        if ui.context.client.page.path == "/":
            scroll_up()
        else:
            ui.navigate.to("/")  # NiceGUI adds the prefix of the page


def has_rest(view: SessionView) -> bool:
    """Return whether a mission ended early, and it or the mission that it continues had begun to run."""
    has_past = view.progress.has_begun or view.past is not None
    is_early = view.state in EARLY_ENDS or view.state is None  # without a state, the robot was busy
    return view.is_over and is_early and has_past


def is_unfinished(view: SessionView) -> bool:
    """Return whether a mission ended early, after its own program had begun to run on the robot."""
    return has_rest(view) and view.progress.has_begun


def can_be_continued(summary: MissionSummary) -> bool:
    """Return whether a mission ran on the robot, or was meant to continue one that ran."""
    return bool(summary.if_tool_dies or summary.continues)


def draw_past(past: MissionPast) -> None:
    """Draw the steps of the earlier mission `past`, which the current mission continues."""
    PlainText("h3", "Done before this program")
    steps = [*zip(past.steps, past.trace, strict=True)]
    if earlier := steps[-_MAX_STEPS:-MAX_OPEN_STEPS]:
        with html.details():
            PlainText("summary", counted(len(earlier), "earlier step"))
            _draw_steps(earlier)
    _draw_steps(steps[-MAX_OPEN_STEPS:])
    if not steps:
        PlainText("p", "No step was finished.")
    PlainText("p", capitalize(past.testimony), "quiet")


def _draw_steps(steps: Sequence[tuple[str, Event]]) -> None:
    with ui.element("ol"):
        for words, event in steps:
            PlainText("li", shortened(words, _MAX_STEP_CHARACTERS), "failed" if event.failed else "")


def origin_text(view: SessionView) -> str:
    """Return a sentence about the mission that this one continues, or an empty string if there is none."""
    if view.past is None:
        return ""
    why = shortened(view.past.why, _MAX_STEP_CHARACTERS)
    sentence = f"Continues mission {view.past.mission}, which ended early: {why}."
    if view.instruction or not view.may_be_edited:
        return sentence
    return f"{sentence} It has no instruction, so a person must write the rest: delete what is done already."


def storyboard_title(view: SessionView) -> str:
    """Return the title of the storyboard, such as `What the rest would do`."""
    if view.is_over:
        return "What the check expected"
    return "What the robot would do" if view.past is None else "What the rest would do"
