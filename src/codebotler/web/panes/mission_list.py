"""The page that lists all missions, with a search and live updates."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from datetime import datetime
from urllib.parse import urlencode

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.core.text.words import counted
from codebotler.missions.display.view import SessionView
from codebotler.missions.display.wording import reason_text, title
from codebotler.missions.storage.log import MissionState, MissionSummary
from codebotler.missions.storage.store import last_rest, read_missions, rest_text, rests_in
from codebotler.web.console import Console
from codebotler.web.frame import DrawnBox, Frame, PlainText, outside
from codebotler.web.live import follow

_MISSIONS_PATH = "/missions"
MAX_LISTED_MISSIONS, MAX_SEARCHED_CHARACTERS = 200, 2_000  # of a program, as long searches delay STOP
_MAX_TITLE, _MAX_LISTED_REASON = 160, 200
_NO_MISSIONS = "No missions yet."


def add(console: Console, frame: Frame) -> None:
    """Add the page `/missions`."""

    @ui.page(_MISSIONS_PATH)
    async def list_missions(text: str = "") -> None:
        frame("Missions", _MISSIONS_PATH)
        with ui.element("div").classes("past"):
            PlainText("h1", "Missions")
            shown = _MissionList(console, text)
            await shown.update()
            await follow(console.notifier, shown.update)


class _MissionList:
    """The search and the list of missions, newest first."""

    def __init__(self, console: Console, text: str) -> None:
        self._console = console
        self._known: list[MissionSummary] = []
        self._seen: object = None
        self._rows: dict[str, DrawnBox[tuple[MissionSummary, str, str]]] = {}  # by mission
        with ui.element("div").classes("filters").props("role=search"):
            self._text = ui.input("Search", value=text, on_change=self._search)
            self._text.props("outlined dense clearable debounce=300 dir=auto maxlength=200")
        self._count = PlainText("p", "", "quiet").props("role=status")
        self._error = PlainText("p", "", "trouble").props("role=alert")
        self._list = ui.element("ol").classes("rows")

    async def update(self) -> None:
        """Reload the list if the state of the current mission has changed."""
        view = self._console.view
        seen = (view.id, view.state, view.reason, view.waits_for_answer)
        if seen == self._seen:
            return
        try:
            self._known = await asyncio.to_thread(read_missions, self._console.home)
        except UserError as error:
            self._error.show_text(str(error))
            return
        self._seen = seen
        self._error.show_text("")
        self._show()

    def _search(self) -> None:
        text = (self._text.value or "").strip()
        query = f"?{urlencode({'text': text})}" if text else ""
        ui.navigate.history.replace(outside(_MISSIONS_PATH) + query)
        self._show()

    def _show(self) -> None:
        words = (self._text.value or "").casefold().split()
        view = self._console.view
        found = [one for one in reversed(self._known) if has_words(one, state_words(one, view), words)]
        self._count.show_text(_count_text(len(found), len(self._known)))
        found, rests = found[:MAX_LISTED_MISSIONS], rests_in(self._known)
        for gone in self._rows.keys() - {one.id for one in found}:
            self._rows.pop(gone).delete()
        for position, one in enumerate(found):  # to draw all rows would delay STOP
            if one.id not in self._rows:
                with self._list:
                    self._rows[one.id] = DrawnBox("", _draw_mission, "li")
                self._rows[one.id].move(self._list, position)
            self._rows[one.id].show((one, state_words(one, view), rest_text(last_rest(one.id, rests))))


def state_words(summary: MissionSummary, view: SessionView) -> str:
    """Return a mission's state, such as `done` or `waits for approval`. `view` is the current mission."""
    if summary.id == view.id and view.waits_for_answer:
        return "waits for an answer"
    return "waits for approval" if summary.state is MissionState.CHECKED else str(summary.state)


def has_words(summary: MissionSummary, state: str, words: Sequence[str]) -> bool:
    """Whether each of `words` (in lower case) is in the ID, state, robot, instruction, program or reason."""
    if not words:
        return True
    program = summary.program[:MAX_SEARCHED_CHARACTERS]
    texts = (summary.id, state, summary.robot, summary.instruction, program, summary.reason)
    everything = "\n".join(texts).casefold()
    return all(word in everything for word in words)


def _count_text(found: int, known: int) -> str:
    if not known:
        return _NO_MISSIONS
    last = f"; showing the latest {MAX_LISTED_MISSIONS:,}" if found > MAX_LISTED_MISSIONS else ""
    return f"{counted(known, 'mission') if found == known else f'{found:,} of {known:,} missions'}{last}"


def _draw_mission(mission: tuple[MissionSummary, str, str]) -> None:
    """Draw a mission with its state, and with what became of its rest."""
    summary, state, rest = mission
    reason = shortened(reason_text(summary.reason, summary.line), _MAX_LISTED_REASON)
    before = f"continues mission {summary.continues}" if summary.continues else ""
    parts = (f"mission {summary.id}", f"robot: {summary.robot}", reason, before, rest)
    with html.a(href=outside(f"{_MISSIONS_PATH}/{summary.id}")):
        PlainText("time", f"{datetime.fromtimestamp(summary.created).astimezone():%d %b %Y, %H:%M}")
        with ui.element("span").classes("about"):
            PlainText("span", shortened(title(summary), _MAX_TITLE), "text")
            PlainText("span", " · ".join(filter(None, parts)), "outcome")
        PlainText("small", state, f"state state-{summary.state}")
