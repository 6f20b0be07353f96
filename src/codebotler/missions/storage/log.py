"""Read and write the files of a mission: a log with one line per event, and a summary."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeAlias

import msgspec

from codebotler.core.errors import UserError
from codebotler.core.files import Appender, read_rows, to_line, write_whole

EVENTS_FILE, SUMMARY_FILE = "events.jsonl", "mission.json"

LogLine: TypeAlias = dict[str, Any]
"""An event: `time` (seconds since 1970), `clock` (seconds on the robot's clock), `event` (kind), and data."""

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
    "past": frozenset({"continues", "trace"}),
    "contract": frozenset({"contracts"}),
}
"""The keys that each kind of event must have."""


class MissionState(StrEnum):
    """The state of a mission. `NEXT_STATES` lists which states can follow."""

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
        """Whether the robot is working or stopping."""
        return self in {MissionState.RUNNING, MissionState.STOPPING}

    @property
    def is_final(self) -> bool:
        """Whether no other state can follow."""
        return self not in NEXT_STATES


NEXT_STATES = {
    MissionState(state): frozenset(map(MissionState, following.split()))
    for state, following in {
        "drafting": "drafting checked failed stopped",
        "checked": "drafting checked approved failed stopped",
        "approved": "running failed stopped",
        "running": "done failed stopping",
        "stopping": "stopped failed",
    }.items()
}
"""The states that can follow each state. States not listed are final. Recovery sets `interrupted`."""


@dataclass
class MissionSummary:
    """A mission's state, instruction, program, times and other facts, stored in a file beside its log."""

    id: str
    state: MissionState
    robot: str  # the kind of robot
    created: float  # seconds since 1970
    instruction: str = ""  # empty if there is only a program
    model: str = ""  # the model that wrote the program; empty if a person did
    program: str = ""
    problems: tuple[str, ...] = ()  # sentences about problems that the check found
    reason: str = ""  # why the mission is in this state
    line: int | None = None  # the program's line at which the mission ended
    ended: float | None = None  # seconds since 1970
    if_tool_dies: str = ""  # what the robot does if CodeBotler ends unexpectedly
    place: str = ""  # where the robot was when the program began; empty if unknown
    continues: str = ""  # the ID of the mission whose rest this one does
    address: str = ""  # where the robot was reached, if it has an address, as `normalize_address` writes it

    @property
    def has_ended(self) -> bool:
        """Whether the mission has reached a final state."""
        return self.state.is_final

    @classmethod
    def read(cls, folder: Path) -> MissionSummary:
        """Read the summary of a mission, or raise UserError if it is damaged."""
        path = folder / SUMMARY_FILE
        try:
            summary = msgspec.convert(json.loads(path.read_bytes()), cls)
            datetime.fromtimestamp(summary.created, UTC)
        except (ValueError, OverflowError, RecursionError, msgspec.ValidationError):
            raise UserError("this is not a valid mission summary; remove its folder", file=path) from None
        return summary

    def write(self, folder: Path) -> None:
        """Write the summary to its file in the mission's folder, atomically."""
        write_whole(folder / SUMMARY_FILE, json.dumps(asdict(self), indent=1).encode())


def open_log(folder: Path) -> Appender:
    """Open and lock the log of a mission, or raise BlockingIOError if another process has it open."""
    return Appender(folder / EVENTS_FILE, exclusive=True)


def add_event(log: Appender, event: str, clock: float, **data: object) -> LogLine:
    """Append an event of kind `event` to a log and return it. `clock` is the robot's clock, in seconds."""
    line = {"time": round(time.time(), 6), "clock": round(clock, 6), "event": event, **data}
    log.append(to_line(line))
    return line


def read_events(folder: Path) -> list[LogLine]:
    """Read the events of a mission, without an incomplete last line. Raise UserError if a line is invalid."""
    return read_log(folder / EVENTS_FILE)


def read_log(path: Path) -> list[LogLine]:
    """Read the events in a log, without an incomplete last line. Raise UserError if a line is invalid."""
    events = []
    for number, line in read_rows(path):
        if not _is_event(line):
            raise UserError("this line is not a mission event; remove the line", file=path, line=number)
        events.append(line)
    return events


def _is_event(line: LogLine) -> bool:
    try:
        kind, is_moment = line["event"], 0 <= line["time"] + line["clock"] < math.inf
    except (KeyError, TypeError):
        return False
    return is_moment and isinstance(kind, str) and _REQUIRED_KEYS.get(kind, frozenset()) <= line.keys()


SKILL_END_EVENTS = frozenset({"result", "error", "cancelled", "late"})
"""The kinds of events that end a skill."""


def find_skill_end(events: Sequence[LogLine], number: int) -> LogLine | None:
    """Return the first event at or after index `number` that ends a skill, such as `result`, or None."""
    later = (events[at] for at in range(number, len(events)))
    return next((line for line in later if line["event"] in SKILL_END_EVENTS), None)


def find_unfinished_skill(events: Sequence[LogLine]) -> LogLine | None:
    """Return the event that started an unfinished skill, or None if all skills have ended."""
    last = next((at for at in reversed(range(len(events))) if events[at]["event"] == "skill"), None)
    return None if last is None or find_skill_end(events, last) else events[last]
