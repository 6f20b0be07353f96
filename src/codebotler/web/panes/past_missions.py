"""The pages about past missions: the list, and the timeline of one."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened, visible
from codebotler.core.words import counted
from codebotler.missions.log import SKILL_ENDS, Line, State, Summary, events_of
from codebotler.missions.store import find, missions
from codebotler.missions.wording import activity, event_text, stop_text, title
from codebotler.web.console import Console
from codebotler.web.frame import Frame, PlainText

MOST, MOST_EVENTS = 200, 1_000
HEADLINES: Mapping[str, str] = {State.DRAFTING: "Program written", State.RUNNING: "Started"}
"""How the timeline names states of a mission, but for those that speak for themselves."""

TOLD_BY_STOP = frozenset({State.STOPPING, State.STOPPED})
"""States that are not shown where a stop is."""


def add(console: Console, frame: Frame) -> None:
    """Add the pages."""

    @ui.page("/missions")
    async def list_missions() -> None:
        frame("Missions", "/missions")
        with ui.element("div").classes("past"):
            PlainText("h1", "Missions")
            try:
                known = await asyncio.to_thread(missions, console.home)
            except UserError as error:
                PlainText("p", str(error), "trouble")
                return
            if not known:
                PlainText("p", "No missions yet.", "quiet")
            with ui.element("ol").classes("rows"):
                for summary in reversed(known[-MOST:]):
                    _row(summary)

    @ui.page("/missions/{mission}")
    async def one(mission: str) -> None:
        frame("Mission", "/missions")
        with ui.element("div").classes("past"):
            try:
                summary, events = await asyncio.to_thread(_read, console, mission)
            except UserError as error:
                PlainText("p", error.sentence, "trouble")
                return
            _show(summary, events)


def timeline(events: Sequence[Line]) -> Iterator[tuple[Line, str]]:
    """The events that are shown, in words; a stop and what it interrupted are one."""
    doing, is_stopped = "", False
    for number, line in enumerate(events):
        event = line["event"]
        if event == "skill" or (event == "sleep" and line["seconds"]):
            doing = activity(line)
        elif event in SKILL_ENDS and event != "cancelled":
            doing = ""
        if event == "stop":
            is_stopped = True
            yield line, _sentence(stop_text(line["by"], doing))
            continue
        is_told = event == "cancelled" or (is_stopped and line.get("state") in TOLD_BY_STOP)
        words = "" if is_told else in_words(line, is_first=number == 0)
        if words:
            yield line, words


def in_words(line: Line, *, is_first: bool) -> str:
    """An event in the timeline; empty if it is not shown."""
    event = line["event"]
    if event == "state":
        state, reason = line["state"], shortened(line.get("reason", ""))
        step = "Mission created" if is_first else HEADLINES.get(state, visible(state).capitalize())
        if state == State.CHECKED:
            problems = len(line.get("problems", ()))
            step = f"Checked: {counted(problems, 'problem') if problems else 'no problems'}"
        return f"{step}: {reason.removeprefix(f'{state} ')}" if reason else step
    return "" if event == "feedback" else _sentence(event_text(line))


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:]


def _read(console: Console, mission: str) -> tuple[Summary, list[Line]]:
    folder = find(console.home, mission)
    return Summary.read(folder), events_of(folder)


def _row(summary: Summary) -> None:
    with ui.element("li"), html.a(href=f"/missions/{summary.id}"):
        PlainText("time", f"{datetime.fromtimestamp(summary.created).astimezone():%d %b %Y, %H:%M}")
        PlainText("span", shortened(title(summary), 160), "text")
        PlainText("small", summary.state, f"state state-{summary.state}")


def _show(summary: Summary, events: list[Line]) -> None:
    began = datetime.fromtimestamp(summary.created).astimezone()
    PlainText("h1", shortened(title(summary), 300))
    with ui.element("p").classes("facts"):
        PlainText("small", summary.state, f"state state-{summary.state}")
        by_hand = " · program typed or changed by hand" if summary.program else ""
        by = f" · program by {summary.model}" if summary.model else by_hand
        PlainText("span", f"{began:%d %b %Y, %H:%M:%S} · robot: {summary.robot}{shortened(by)}")
    if summary.reason:
        PlainText("p", shortened(summary.reason), "reason")
    with ui.element("p").classes("downloads"):
        for kind, name in (("jsonl", "Events (JSON lines)"), ("mcap", "MCAP, for Foxglove")):
            html.a(name, href=f"/api/missions/{summary.id}/events.{kind}").props("download")
    for problem in summary.problems:
        PlainText("p", shortened(problem), "trouble")
    PlainText("h2", "What happened")
    with ui.element("ol").classes("timeline"):
        for line, words in timeline(events[:MOST_EVENTS]):
            with ui.element("li").classes(f"event event-{line['event']}"):
                PlainText("time", f"{datetime.fromtimestamp(line['time']).astimezone():%H:%M:%S}")
                PlainText("small", f"{line['clock']:.1f} s" if line["clock"] else "")
                PlainText("span", words, "text")
    if len(events) > MOST_EVENTS:
        PlainText("p", f"{len(events) - MOST_EVENTS:,} more events are in the downloads above.", "quiet")
    PlainText("h2", "Program")
    PlainText("pre", summary.program, "source").props("tabindex=0")
