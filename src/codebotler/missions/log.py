"""The files of a mission: a log with a line for each event as it happens, and a summary."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.files import Appender, read_rows, to_line, write_whole

EVENTS, SUMMARY = "events.jsonl", "mission.json"

Line: TypeAlias = dict[str, Any]
"""An event: `time` (seconds since 1970), `clock` (the robot's, in seconds), `event` (what kind), and more."""

TEXTS = ("id", "robot", "instruction", "model", "program", "reason", "if_tool_dies")  # of a summary
HAS: Mapping[str, frozenset[str]] = {
    "state": frozenset({"state"}),
    "skill": frozenset({"number", "skill", "arguments"}),
    "feedback": frozenset({"number", "skill", "text"}),
    "result": frozenset({"number", "skill", "result"}),
    "error": frozenset({"number", "skill", "kind", "message"}),
    **dict.fromkeys(("cancelled", "picture", "late"), frozenset({"number", "skill"})),
    "sleep": frozenset({"seconds"}),
    "stop": frozenset({"by"}),
    "rule": frozenset({"rule", "says", "formula"}),
    "log": frozenset({"text"}),
    "map": frozenset({"rooms", "robot"}),
}
"""What belongs to each kind of event."""


class State(StrEnum):
    """The states of a mission."""

    DRAFTING = "drafting"
    CHECKED = "checked"
    APPROVED = "approved"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    STOPPING = "stopping"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"

    @property
    def is_open(self) -> bool:
        """Whether the program can still be replaced."""
        return self in {State.DRAFTING, State.CHECKED}

    @property
    def is_moving(self) -> bool:
        """Whether the robot works, or ends what it did."""
        return self in {State.RUNNING, State.STOPPING}

    @property
    def is_final(self) -> bool:
        """Whether no other state follows."""
        return self not in TRANSITIONS


TRANSITIONS: dict[State, frozenset[State]] = {
    State.DRAFTING: frozenset({State.DRAFTING, State.CHECKED, State.FAILED, State.STOPPED}),
    State.CHECKED: frozenset(
        {State.DRAFTING, State.CHECKED, State.APPROVED, State.FAILED, State.STOPPED},
    ),
    State.APPROVED: frozenset({State.RUNNING, State.FAILED, State.STOPPED}),
    State.RUNNING: frozenset({State.DONE, State.FAILED, State.STOPPING}),
    State.STOPPING: frozenset({State.STOPPED, State.FAILED}),
}
"""The states that may follow each state; the others are final. A tool that dies leaves it interrupted."""


@dataclass
class Summary:
    """A mission in short."""

    id: str  # by which it is found
    state: State
    robot: str  # its kind
    created: float  # seconds since 1970
    instruction: str = ""  # empty if the program did not come from one
    model: str = ""  # that wrote the program, if one did
    program: str = ""
    problems: tuple[str, ...] = ()  # found by the check, in sentences
    reason: str = ""  # for its state, in a sentence
    line: int | None = None  # of the program, at which it ended
    ended: float | None = None  # seconds since 1970
    if_tool_dies: str = ""  # what becomes of the robot then

    @property
    def has_ended(self) -> bool:
        """Whether its state is final."""
        return self.state.is_final

    @classmethod
    def read(cls, folder: Path) -> Summary:
        """The summary of a mission, or a UserError."""
        path = folder / SUMMARY
        try:
            data = json.loads(path.read_bytes())
            summary = cls(**{field.name: data[field.name] for field in fields(cls) if field.name in data})
            summary.state, summary.problems = State(summary.state), tuple(summary.problems)
            datetime.fromtimestamp(summary.created, UTC)
            "".join((*summary.problems, *(getattr(summary, name) for name in TEXTS)))
        except (ValueError, TypeError, OverflowError, RecursionError):
            raise UserError("this is not the summary of a mission; remove its folder", file=path) from None
        return summary

    def write(self, folder: Path) -> None:
        """Write it whole, or leave what was there."""
        write_whole(folder / SUMMARY, json.dumps(asdict(self), indent=1).encode())


def log_of(folder: Path) -> Appender:
    """The log of a mission, locked until it is closed; BlockingIOError if another process has it open."""
    return Appender(folder / EVENTS, exclusive=True)


def add_event(log: Appender, event: str, clock: float, **data: object) -> Line:
    """Write an event at this moment, and return it."""
    line = {"time": round(time.time(), 6), "clock": round(clock, 6), "event": event, **data}
    log.append(to_line(line))
    return line


def events_of(folder: Path) -> list[Line]:
    """The events of a mission, without a torn last line; UserError if a line is something else."""
    path, events = folder / EVENTS, []
    for number, line in read_rows(path, growing=True):
        if not _is_event(line):
            raise UserError("this is not an event of a mission; remove the line", file=path, line=number)
        events.append(line)
    return events


def _is_event(line: Line) -> bool:
    try:
        kind, is_moment = line["event"], 0 <= line["time"] + line["clock"] < math.inf
    except (KeyError, TypeError):
        return False
    return is_moment and isinstance(kind, str) and HAS.get(kind, frozenset()) <= line.keys()


SKILL_ENDS = frozenset({"result", "error", "cancelled", "late"})
"""The events with which a skill ends."""


def doing(events: Iterable[Line]) -> Line | None:
    """The skill that went on when the events broke off, if one did."""
    going: Line | None = None
    for line in events:
        if line["event"] == "skill":
            going = line
        elif line["event"] in SKILL_ENDS:
            going = None
    return going
