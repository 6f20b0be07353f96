"""The instruction pane: what the robot is to do, and which model writes the program."""

from __future__ import annotations

import asyncio

from nicegui import html, ui

from codebotler.checking.room_names import named_rooms
from codebotler.core.errors import UserError
from codebotler.core.program import called_skills, tree_of
from codebotler.core.terminal import shortened, visible, visible_lines
from codebotler.missions.log import Summary
from codebotler.missions.mission import MissionError
from codebotler.missions.preflight import unknown_rooms
from codebotler.missions.store import missions
from codebotler.missions.view import Order, SessionView
from codebotler.models.recorded import is_recorded, recorded_model
from codebotler.simulator.sampled_robot import RoomMap
from codebotler.web.console import Console
from codebotler.web.frame import Button, PlainText, scroll_up, warn

UNKNOWN = "There is no recorded program for this instruction. Choose an instruction below, or another model."
MOST_EXAMPLES, MOST_BEFORE, MOST_TEXT = 4, 6, 400
ABOUT_RECORDED = (
    "This is not a language model: its programs were written by people, so you can try everything without an "
    "API key. It knows only a few instructions, such as the examples below."
)


class InstructionPane:
    """Takes an instruction and the choice of a model."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._number = -1
        self._asked = ""
        self._suggested: tuple[str, ...] = ()
        with ui.element("section").classes("pane instruct").props('aria-labelledby="h-instruct"'):
            PlainText("h2", "Instruct").props("id=h-instruct")
            self._text = (
                ui.textarea("What should the robot do?")
                .props('outlined autogrow input-class="words" maxlength=200000 dir=auto')
                .on("keydown.ctrl.enter", self._ask)
            )
            self._model = ui.select(
                {name: visible(name) for name in console.models},
                value=console.models[0],
                label="Model",
            )
            self._model.props("outlined dense").on_value_change(self._about_model)
            self._about = PlainText("p", ABOUT_RECORDED, "quiet")
            self._write = Button("Write the program", self._ask, "primary")
            self._trouble = PlainText("p", "", "trouble").props("role=alert")
            self._alike = ui.element("div").classes("picks")
            self._examples = ui.element("div").classes("picks")
            self._before = ui.element("div").classes("picks")
        self._about_model()
        self._trouble.say("")

    async def load(self) -> None:
        """Add the examples and the recent instructions, which are read from files."""
        examples = await asyncio.to_thread(_examples, self._console)
        before = await asyncio.to_thread(_before, self._console)
        if self._examples.is_deleted:  # the page was closed meanwhile
            return
        if examples:
            self._fill(self._examples, "Examples", [(text, "") for text in examples])
        if before:
            self._fill(self._before, "Recent", [(summary.instruction, summary.state) for summary in before])

    def show(self, view: SessionView) -> None:
        """Show a view."""
        if view.number != self._number:
            self._number = view.number
            if (self._text.value or "").strip() in {"", self._asked}:  # nobody is typing another one here
                self._text.value = visible_lines(view.instruction)
            self._asked = visible_lines(view.instruction)
        self._write.allow(not view.is_written and not view.is_running)
        self._write.say("Writing …" if view.is_written else "Write the program")
        self._trouble.say(UNKNOWN if view.known else view.trouble)
        self._suggest(view.known)

    def _ask(self) -> None:
        try:
            self._console.begin(Order(self._text.value or "", self._model.value or ""))
        except (MissionError, UserError) as error:
            warn(error.sentence)
        else:
            scroll_up()

    def _about_model(self) -> None:
        self._about.set_visibility(is_recorded(str(self._model.value)))

    def _suggest(self, known: tuple[str, ...]) -> None:
        """Offer known instructions that are alike, and fit the rooms that are there."""
        if known == self._suggested:
            return
        self._suggested = known
        self._alike.clear()
        fitting = [text for text in known if _fits(text, self._console)]
        if fitting:
            self._fill(self._alike, "Similar instructions", [(text, "") for text in fitting])

    def _fill(self, where: ui.element, title: str, texts: list[tuple[str, str]]) -> None:
        where.clear()
        with where:
            PlainText("h3", title)
            for text, state in texts:
                with html.button(type="button").classes("pick").on("click", lambda t=text: self._take(t)):
                    PlainText("span", shortened(text, MOST_TEXT))
                    if state:
                        PlainText("small", state, f"state state-{state}")

    def _take(self, text: str) -> None:
        self._text.value = visible_lines(text)
        scroll_up()


def _examples(console: Console) -> list[str]:
    """Short instructions that the recorded model knows, of different kinds, for rooms that are there."""
    found: dict[frozenset[str], str] = {}
    for instruction, replies in sorted(
        recorded_model("recorded:careful").replies.items(), key=lambda known: len(known[0])
    ):
        if _fits(instruction, console):
            found.setdefault(frozenset(called_skills(tree_of(replies[0].program))), instruction)
    return list(found.values())[:MOST_EXAMPLES]


def _fits(instruction: str, console: Console) -> bool:
    """Whether the rooms of a recorded program are there."""
    program = recorded_model("recorded:careful").replies[instruction][0].program
    if console.world is None:
        return True
    return bool(named_rooms(tree_of(program))) and not unknown_rooms(program, RoomMap.of(console.world))


def _before(console: Console) -> list[Summary]:
    """The last different instructions."""
    try:
        known = missions(console.home)
    except (UserError, OSError):
        return []
    last = {summary.instruction: summary for summary in known if summary.instruction}
    return sorted(last.values(), key=lambda summary: -summary.created)[:MOST_BEFORE]
