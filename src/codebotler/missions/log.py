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

EVENTS_FILE, SUMMARY_FILE = "events.jsonl", "mission.json"

LogLine: TypeAlias = dict[str, Any]
"""An event: `time` (seconds since 1970), `clock` (the robot's, in seconds), `event` (what kind), and more."""

_TEXT_FIELDS = ("id", "robot", "instruction", "model", "program", "reason", "if_tool_dies")  # of a summary
_REQUIRED_KEYS: Mapping[str, frozenset[str]] = {
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


class MissionState(StrEnum):
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
        return self in {MissionState.DRAFTING, MissionState.CHECKED}

    @property
    def is_moving(self) -> bool:
        """Whether the robot works, or ends what it did."""
        return self in {MissionState.RUNNING, MissionState.STOPPING}

    @property
    def is_final(self) -> bool:
        """Whether no other state follows."""
        return self not in NEXT_STATES


NEXT_STATES: dict[MissionState, frozenset[MissionState]] = {
    MissionState.DRAFTING: frozenset(
        {MissionState.DRAFTING, MissionState.CHECKED, MissionState.FAILED, MissionState.STOPPED}
    ),
    MissionState.CHECKED: frozenset(
        {
            MissionState.DRAFTING,
            MissionState.CHECKED,
            MissionState.APPROVED,
            MissionState.FAILED,
            MissionState.STOPPED,
        }
    ),
    MissionState.APPROVED: frozenset({MissionState.RUNNING, MissionState.FAILED, MissionState.STOPPED}),
    MissionState.RUNNING: frozenset({MissionState.DONE, MissionState.FAILED, MissionState.STOPPING}),
    MissionState.STOPPING: frozenset({MissionState.STOPPED, MissionState.FAILED}),
}
"""The states that may follow each state; the others are final. A tool that dies leaves it interrupted."""


@dataclass
class MissionSummary:
    """A mission in short."""

    id: str  # by which it is found
    state: MissionState
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
    def read(cls, folder: Path) -> MissionSummary:
        """The summary of a mission, or a UserError."""
        path = folder / SUMMARY_FILE
        try:
            data = json.loads(path.read_bytes())
            summary = cls(**{field.name: data[field.name] for field in fields(cls) if field.name in data})
            summary.state, summary.problems = MissionState(summary.state), tuple(summary.problems)
            datetime.fromtimestamp(summary.created, UTC)
            "".join((*summary.problems, *(getattr(summary, name) for name in _TEXT_FIELDS)))
        except (ValueError, TypeError, OverflowError, RecursionError):
            raise UserError("this is not the summary of a mission; remove its folder", file=path) from None
        return summary

    def write(self, folder: Path) -> None:
        """Write it whole, or leave what was there."""
        write_whole(folder / SUMMARY_FILE, json.dumps(asdict(self), indent=1).encode())


def open_log(folder: Path) -> Appender:
    """The log of a mission, locked until it is closed; BlockingIOError if another process has it open."""
    return Appender(folder / EVENTS_FILE, exclusive=True)


def add_event(log: Appender, event: str, clock: float, **data: object) -> LogLine:
    """Write an event at this moment, and return it."""
    line = {"time": round(time.time(), 6), "clock": round(clock, 6), "event": event, **data}
    log.append(to_line(line))
    return line


def read_events(folder: Path) -> list[LogLine]:
    """The events of a mission, without a torn last line; UserError if a line is something else."""
    path, events = folder / EVENTS_FILE, []
    for number, line in read_rows(path, growing=True):
        if not _is_event(line):
            raise UserError("this is not an event of a mission; remove the line", file=path, line=number)
        events.append(line)
    return events


def _is_event(line: LogLine) -> bool:
    try:
        kind, is_moment = line["event"], 0 <= line["time"] + line["clock"] < math.inf
    except (KeyError, TypeError):
        return False
    return is_moment and isinstance(kind, str) and _REQUIRED_KEYS.get(kind, frozenset()) <= line.keys()


SKILL_END_EVENTS = frozenset({"result", "error", "cancelled", "late"})
"""The events with which a skill ends."""


def find_unfinished_skill(events: Iterable[LogLine]) -> LogLine | None:
    """The skill that went on when the events broke off, if one did."""
    going: LogLine | None = None
    for line in events:
        if line["event"] == "skill":
            going = line
        elif line["event"] in SKILL_END_EVENTS:
            going = None
    return going
