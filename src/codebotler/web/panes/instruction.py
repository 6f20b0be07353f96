"""The instruction pane: the instruction and the choice of a model."""

from __future__ import annotations

import asyncio
from functools import partial

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.program import called_skills, parse_leniently
from codebotler.core.terminal import shortened, visible, visible_lines
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.preflight import known_instructions
from codebotler.missions.storage.log import MissionSummary
from codebotler.missions.storage.store import read_missions
from codebotler.models.recorded import is_recorded
from codebotler.models.usable import MODEL_HINT
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.web.console import Console
from codebotler.web.frame import Button, DrawnBox, PlainText, scroll_to, scroll_up, warned

_NO_RECORDED_PROGRAM = "There is no recorded program for this instruction."
_HOW_TO_ADD_MODEL = (
    f"For other instructions, {MODEL_HINT}, and restart codebotler serve with --model NAME; "
    "codebotler models lists the names."
)
_MAX_EXAMPLES, _MAX_RECENT, _MAX_PICK_CHARACTERS = 4, 6, 400
_ABOUT_RECORDED = (
    "This is not a language model: people wrote its programs, so you can try everything without an API key. "
    "It knows only a few instructions"
)


class InstructionPane:
    """Lets an operator write an instruction and choose a model."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._shown = -1, ""
        self._asked = ""
        self._ended = ""
        with ui.element("section").classes("pane instruct").props('aria-labelledby="h-instruct"'):
            PlainText("h2", "Instruct").props("id=h-instruct")
            self._text = (
                ui.textarea("What should the robot do?")
                .props('outlined autogrow input-class="words" maxlength=200000 dir=auto')
                .on("keydown.ctrl.enter", self._ask)
            )
            self._model = ui.select(
                {name: visible(name) for name in console.models}, value=console.models[0], label="Model"
            )
            self._model.props("outlined dense").on_value_change(self._about_model)
            self._about = PlainText("p", f"{_ABOUT_RECORDED}.", "quiet")
            self._write = Button("Write the program", self._ask, "primary")
            self._error = PlainText("p", "", "trouble").props("role=alert")
            self._similar = DrawnBox("picks", partial(self._draw_picks, "Instructions it knows"))
            self._examples = DrawnBox("picks", partial(self._draw_picks, "Examples"))
            self._recent = DrawnBox("picks", partial(self._draw_picks, "Recent"))
        self._about_model()
        self._error.show_text("")

    @property
    def model(self) -> str:
        """The name of the chosen model."""
        return str(self._model.value or "")

    async def load(self) -> None:
        """Read the examples and the recent instructions, and add them to the pane."""
        shown = await asyncio.to_thread(examples, self._console)
        if not self._examples.is_deleted:  # the page may have been closed in the meantime
            some = ", such as the examples below." if shown else ", and none of them fits these rooms."
            self._about.text = _ABOUT_RECORDED + some
            self._examples.show([(text, "") for text in shown] or None)
        await self._load_recent()

    async def follow(self, view: SessionView) -> None:
        """Refresh the recent instructions after the end of a mission."""
        if view.is_over and view.id != self._ended:
            self._ended = view.id
            await self._load_recent()

    async def _load_recent(self) -> None:
        recent = await asyncio.to_thread(_recent, self._console)
        if not self._recent.is_deleted:
            texts = [(one.instruction, one.state if one.has_ended else "") for one in recent]
            self._recent.show(texts or None)

    def show(self, view: SessionView) -> None:
        """Show the mission's instruction and its error, but keep an instruction that is being typed."""
        if (view.number, view.instruction) != self._shown:
            self._shown = view.number, view.instruction
            if (self._text.value or "").strip() in {"", self._asked}:  # keep text that is being typed
                self._text.value = visible_lines(view.instruction)
            self._asked = visible_lines(view.instruction)
            if view.model in self._console.models:
                self._model.value = view.model
        self._write.allow(not view.is_written and not view.is_running)
        self._write.show_text("Writing …" if view.is_written else "Write the program")
        self._error.show_text(view.error if view.suggestions is None else self._unknown(view.suggestions))
        self._similar.show([(text, "") for text in view.suggestions or ()] or None)

    def _ask(self) -> None:
        with warned():
            self._console.begin(MissionOrder(self._text.value or "", self.model))
            scroll_up()

    def _about_model(self) -> None:
        self._about.set_visibility(is_recorded(self.model))

    def _unknown(self, known: tuple[str, ...]) -> str:
        choose = "Choose one below. " if known else ""
        has_only_recorded = all(map(is_recorded, self._console.models))
        how = _HOW_TO_ADD_MODEL if has_only_recorded else "You can also choose another model."
        return f"{_NO_RECORDED_PROGRAM} {choose}{how}"

    def _draw_picks(self, title: str, texts: list[tuple[str, str]]) -> None:
        PlainText("h3", title)
        for text, state in texts:
            with html.button(type="button").classes("pick").on("click", partial(self._copy, text)):
                PlainText("span", shortened(text, _MAX_PICK_CHARACTERS))
                if state:
                    PlainText("small", state, f"state state-{state}")

    def _copy(self, text: str) -> None:
        self._text.value = visible_lines(text)
        scroll_to("h-instruct")


def examples(console: Console) -> list[str]:
    """Return up to 4 short recorded instructions for this world, which use different skills."""
    room_map = None if console.world is None else RoomMap.of(console.world)
    known = known_instructions(room_map)
    found: dict[frozenset[str], str] = {}
    for instruction in sorted(known, key=len):
        found.setdefault(frozenset(called_skills(parse_leniently(known[instruction]))), instruction)
    return list(found.values())[:_MAX_EXAMPLES]


def _recent(console: Console) -> list[MissionSummary]:
    try:
        known = read_missions(console.home)
    except (UserError, OSError):
        return []
    ran = [one for one in known if one.if_tool_dies or not one.continues]  # not what would have been a rest
    last = {summary.instruction: summary for summary in ran if summary.instruction}
    return sorted(last.values(), key=lambda summary: -summary.created)[:_MAX_RECENT]
