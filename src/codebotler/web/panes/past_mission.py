"""The page of one mission: its outcome, timeline and program, with live updates."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from datetime import datetime
from functools import partial

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.missions.display.wording import capitalize, reason_text, timeline, title
from codebotler.missions.storage.log import LogLine, MissionSummary, read_events
from codebotler.missions.storage.store import find_mission, find_rest
from codebotler.web.console import Console
from codebotler.web.frame import DrawnBox, Frame, PlainText, outside
from codebotler.web.live import follow
from codebotler.web.panes.continuing import EARLY_ENDS, ContinueButton, can_be_continued
from codebotler.web.panes.mission_list import state_words

MAX_LISTED_EVENTS, _MAX_CODE_CHARACTERS = 1_000, 200


def add(console: Console, frame: Frame) -> None:
    """Add the page of one mission, `/missions/ID`."""

    @ui.page("/missions/{mission}")
    async def one(mission: str) -> None:
        frame("Mission", "/missions")
        with ui.element("div").classes("past"):
            try:
                summary, events, rest = await asyncio.to_thread(_read, console, mission)
            except UserError as error:
                PlainText("p", error.sentence, "trouble")
                return
            page = _MissionPage(console, summary)
            page.show(summary, events, rest)
            if summary.state in EARLY_ENDS and can_be_continued(summary) and rest is None:
                with page.rest:
                    ContinueButton(console, summary.id)
            if not summary.has_ended:
                await follow(console.notifier, partial(_update, console, page))


async def _update(console: Console, page: _MissionPage) -> None:
    """Refresh the page if it shows the current mission of this process."""
    if page.mission == console.view.id and not page.has_ended:
        read = await asyncio.to_thread(_read, console, page.mission)
        if not page.rest.is_deleted:
            page.show(*read)


def _read(console: Console, mission: str) -> tuple[MissionSummary, list[LogLine], MissionSummary | None]:
    """Return the summary and the events of a mission, and the mission that did its rest."""
    folder = find_mission(console.home, mission)
    return MissionSummary.read(folder), read_events(folder), find_rest(folder)


class _MissionPage:
    def __init__(self, console: Console, summary: MissionSummary) -> None:
        self.mission, self.has_ended = summary.id, False
        self._console = console
        self._count = 0
        self._head = DrawnBox("mission-head", _draw_header)
        self.rest = ui.element("div").classes("mission-rest")
        PlainText("h2", "What happened")
        self._timeline = ui.element("ol").classes("timeline")
        self._more = PlainText("p", "", "quiet")
        PlainText("h2", "Program")
        self._source = DrawnBox("source", _draw_source, "pre").props("tabindex=0 dir=auto")

    def show(self, summary: MissionSummary, events: Sequence[LogLine], rest: MissionSummary | None) -> None:
        """Show a mission with its events, and a link to the mission that continued it, if any."""
        self.has_ended = summary.has_ended
        self._head.show((summary, state_words(summary, self._console.view), rest))
        self._source.show(summary)
        steps = list(timeline(events[:MAX_LISTED_EVENTS]))
        with self._timeline:
            for line, words in steps[self._count :]:
                _draw_event(line, words)
        self._count = len(steps)
        more = len(events) - MAX_LISTED_EVENTS
        self._more.show_text(f"Download the events to see {more:,} more." if more > 0 else "")


def _draw_header(mission: tuple[MissionSummary, str, MissionSummary | None]) -> None:
    summary, state, rest = mission
    began = datetime.fromtimestamp(summary.created).astimezone()
    PlainText("h1", shortened(title(summary), 300))
    with ui.element("div").classes(f"ending ending-{summary.state}"):
        PlainText("small", state, f"state state-{summary.state}")
        if summary.reason:
            PlainText("span", shortened(reason_text(summary.reason, summary.line)), "reason")
        if code := _last_line(summary):
            PlainText("code", shortened(code, _MAX_CODE_CHARACTERS))
    by_hand = " · program typed or edited by hand" if summary.program else ""
    by = f" · program by {summary.model}" if summary.model else by_hand
    robot = f"robot: {summary.robot}{shortened(by)}"
    PlainText("p", f"mission {summary.id} · {began:%d %b %Y, %H:%M:%S} · {robot}", "facts")
    if summary.continues:
        _draw_link("Continues", summary.continues, "")
    if rest is not None:
        _draw_link("Continued by", rest.id, rest.state)
    with ui.element("p").classes("downloads"):
        for kind, name in (("jsonl", "Events (JSON lines)"), ("mcap", "MCAP, for Foxglove")):
            html.a(name, href=outside(f"/api/missions/{summary.id}/events.{kind}")).props("download")
    for problem in summary.problems:
        PlainText("p", shortened(problem), "trouble")


def _draw_link(words: str, mission: str, state: str) -> None:
    with ui.element("p").classes("chain"):
        PlainText("span", words)
        with html.a(href=outside(f"/missions/{mission}")):
            PlainText("span", f"mission {mission}")
        PlainText("span", state)


def _last_line(summary: MissionSummary) -> str:
    """Return the unindented program line at which the mission ended, or an empty string if unknown."""
    lines, number = ["", *summary.program.split("\n")], summary.line or 0
    return lines[number].strip() if 0 < number < len(lines) else ""


def _draw_source(summary: MissionSummary) -> None:
    lines = summary.program.split("\n")
    at = summary.line if _last_line(summary) else None
    if at is None:
        PlainText("span", summary.program)
        return
    PlainText("span", "".join(f"{line}\n" for line in lines[: at - 1]))
    PlainText("mark", lines[at - 1], "failed-line")
    PlainText("span", "".join(f"\n{line}" for line in lines[at:]))


def _draw_event(line: LogLine, words: str) -> None:
    with ui.element("li").classes(f"event event-{line['event']}"):
        PlainText("time", f"{datetime.fromtimestamp(line['time']).astimezone():%H:%M:%S}")
        PlainText("small", f"{line['clock']:.1f} s" if line["clock"] else "")
        PlainText("span", capitalize(words), "text")
