"""The pages about past missions: all of them, and one with what happened when."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from datetime import datetime

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened, visible
from codebotler.missions.log import Line, Summary, events_of
from codebotler.missions.mission import State
from codebotler.missions.store import find, missions, summary_of
from codebotler.missions.wording import event_text
from codebotler.web.console import Console
from codebotler.web.elements import Words
from codebotler.web.frame import Frame

MOST, MOST_EVENTS = 200, 1_000
STEPS: Mapping[str, str] = {
    State.DRAFTING: "A program is there",
    State.CHECKED: "The program is checked",
    State.APPROVED: "Somebody lets the robot run it",
    State.RUNNING: "The robot begins",
    State.DONE: "The robot is done",
    State.FAILED: "The program broke off",
    State.STOPPING: "The robot is being stopped",
    State.STOPPED: "The mission is stopped",
    State.INTERRUPTED: "The mission was interrupted",
}
"""What it means that a mission comes to a state."""


def add(console: Console, frame: Frame) -> None:
    """Put the pages at their addresses.

    Args:
        console: whose missions.
        frame: what all pages have.
    """

    @ui.page("/missions")
    async def list_missions() -> None:
        frame("Missions", "/missions")
        with ui.element("div").classes("past"):
            Words("h1", "Missions")
            try:
                known = await asyncio.to_thread(missions, console.home)
            except UserError as error:
                Words("p", str(error), "trouble")
                return
            if not known:
                Words("p", "There is none yet.", "quiet")
            with ui.element("ol").classes("rows"):
                for summary in reversed(known[-MOST:]):
                    _row(summary)

    @ui.page("/missions/{mission}")
    async def one(mission: str) -> None:
        frame("Mission", "")
        with ui.element("div").classes("past"):
            try:
                summary, events = await asyncio.to_thread(_read, console, mission)
            except UserError as error:
                Words("p", error.sentence, "trouble")
                return
            _show(summary, events)


def in_words(line: Line, *, is_first: bool) -> str:
    """What happened, as one tells it to a person; empty where there is nothing to tell.

    Args:
        line: the event.
        is_first: whether the mission begins with it.
    """
    event = line["event"]
    if event == "state":
        state, reason = line["state"], shortened(line.get("reason", ""))
        step = "The mission begins" if is_first else STEPS.get(state, visible(state))
        return f"{step}: {reason.removeprefix(f'{state} ')}" if reason else step
    text = "" if event == "feedback" else event_text(line)
    return text[:1].upper() + text[1:]


def _read(console: Console, mission: str) -> tuple[Summary, list[Line]]:
    folder = find(console.home, mission)
    return summary_of(folder), events_of(folder)


def _row(summary: Summary) -> None:
    with ui.element("li"), html.a(href=f"/missions/{summary.id}"):
        Words("time", f"{datetime.fromtimestamp(summary.created).astimezone():%d %b %Y, %H:%M}")
        Words("span", shortened(summary.instruction or "a program written by hand", 160), "text")
        Words("small", summary.state, f"state state-{summary.state}")


def _show(summary: Summary, events: list[Line]) -> None:
    began = datetime.fromtimestamp(summary.created).astimezone()
    Words("h1", shortened(summary.instruction, 300) or "A program written by hand")
    with ui.element("p").classes("facts"):
        Words("small", summary.state, f"state state-{summary.state}")
        by = f" · written by {summary.model}" if summary.model else ""
        Words("span", f"{began:%d %b %Y, %H:%M:%S} · robot: {summary.robot}{shortened(by)}")
    if summary.reason:
        Words("p", shortened(summary.reason), "reason")
    with ui.element("p").classes("downloads"):
        for kind, name in (("jsonl", "Events (JSON lines)"), ("mcap", "MCAP, for Foxglove")):
            html.a(name, href=f"/api/missions/{summary.id}/events.{kind}").props("download")
    for problem in summary.problems:
        Words("p", shortened(problem), "trouble")
    Words("h2", "What happened")
    with ui.element("ol").classes("timeline"):
        for number, line in enumerate(events[:MOST_EVENTS]):
            words = in_words(line, is_first=number == 0)
            if words:
                with ui.element("li").classes(f"event event-{line['event']}"):
                    Words("time", f"{datetime.fromtimestamp(line['time']).astimezone():%H:%M:%S}")
                    Words("small", f"{line['clock']:.1f} s" if line["clock"] else "")
                    Words("span", words, "text")
    if len(events) > MOST_EVENTS:
        Words("p", f"{len(events) - MOST_EVENTS:,} more; all of them are in the files.", "quiet")
    Words("h2", "Program")
    Words("pre", summary.program, "source").props("tabindex=0")
