"""Past missions on the disk: listed, found, and closed if the tool died."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.missions.log import SUMMARY, Line, Log, Summary, doing, events_of
from codebotler.missions.mission import STEPS, State
from codebotler.missions.wording import call_text

ID = re.compile(r"\d{8}-\d{6}(-\d+)?")


def missions(home: Path) -> list[Summary]:
    """All missions, oldest first; raises UserError if one cannot be read."""
    return sorted(map(summary_of, _folders(home)), key=lambda summary: (summary.created, summary.id))


def find(home: Path, name: str) -> Path:
    """The folder of a mission, by its name or `last`; raises UserError if there is none."""
    if name == "last" and (known := missions(home)):
        return home / "missions" / known[-1].id
    folder = home / "missions" / name
    if not ID.fullmatch(name) or not (folder / SUMMARY).is_file():
        raise UserError(f'there is no mission "{name}"; `codebotler missions` lists them')
    return folder


def summary_of(folder: Path) -> Summary:
    """The summary of a mission; raises UserError if the file is something else."""
    summary = Summary.read(folder)
    if summary.state not in tuple(State):
        raise UserError("this is no summary of a mission; remove its folder", file=folder / SUMMARY)
    return summary


def untold(_mission: str, _error: OSError) -> None:
    """Do nothing with a mission that cannot be closed."""


def recover(home: Path, unclosed: Callable[[str, OSError], None] = untold) -> list[Summary]:
    """Close the missions that were interrupted because the tool died.

    Args:
        home: the folder of missions.
        unclosed: called with each mission that cannot be closed, and why: a full disk stops no robot.

    Returns:
        the missions closed now; unreadable ones are left to `missions`.
    """
    found = []
    for folder in _folders(home):
        try:
            found += _interrupted(folder)
        except UserError:
            continue
        except OSError as error:
            unclosed(folder.name, error)
    return found


def _folders(home: Path) -> list[Path]:
    """The folders of missions."""
    folder = home / "missions"
    try:
        found = sorted(folder.iterdir())
    except FileNotFoundError:
        return []
    except NotADirectoryError:
        raise UserError(
            "this is a file, not a folder of missions; set CODEBOTLER_HOME to another folder", file=folder
        ) from None
    return [path for path in found if os.path.exists(path / SUMMARY)]  # noqa: PTH110 - raises nothing


def _interrupted(folder: Path) -> list[Summary]:
    """The mission, if it was interrupted and not closed."""
    if State(summary_of(folder).state) not in STEPS:
        return []
    try:
        log = Log(folder)
    except BlockingIOError:
        return []  # another tool is on it
    try:
        summary = summary_of(folder)
        if State(summary.state) not in STEPS:
            return []
        events = events_of(folder)
        told = _last_told(events)
        if told is not None and State(told["state"]) not in STEPS:
            summary.state, summary.reason, summary.ended = told["state"], told.get("reason", ""), told["time"]
            summary.write(folder)
            return []
        summary.reason, clock = _how(summary, events), events[-1]["clock"] if events else 0.0
        summary.state, summary.ended = State.INTERRUPTED, time.time()
        log.add("state", clock=clock, state=summary.state, reason=summary.reason)
        summary.write(folder)
        return [summary]
    finally:
        log.close()


def _last_told(events: list[Line]) -> Line | None:
    """The last event with a state."""
    return next((line for line in reversed(events) if line["event"] == "state"), None)


def _how(summary: Summary, events: list[Line]) -> str:
    if State(summary.state) not in {State.RUNNING, State.STOPPING}:
        return f"CodeBotler ended unexpectedly while the mission was {summary.state}; nothing had moved"
    skill = doing(events)
    if skill is None:
        return "CodeBotler ended unexpectedly while the robot was idle"
    going = call_text(skill["skill"], list(skill["arguments"].values()))
    where = next((e["text"] for e in reversed(events) if e["event"] == "feedback"), "")
    where = f" ({where})" if where else ""
    return f"CodeBotler ended unexpectedly during {going}{where}; {summary.if_tool_dies}"
