"""The files of a mission: a log with one line per event, and a summary."""

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
"""An event: `time` (seconds since 1970), `clock` (robot seconds), `event` (its kind), and its data."""

_TEXT_FIELDS = ("id", "robot", "instruction", "model", "program", "reason", "if_tool_dies")
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
"""The keys of each kind of event."""


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
        """Whether the robot works or is stopping."""
        return self in {MissionState.RUNNING, MissionState.STOPPING}

    @property
    def is_final(self) -> bool:
        """Whether no other state follows."""
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
"""The possible next states; the other states are final. A mission whose process died becomes interrupted."""


@dataclass
class MissionSummary:
    """The main facts of a mission."""

    id: str
    state: MissionState
    robot: str  # the kind of robot
    created: float  # seconds since 1970
    instruction: str = ""  # empty if the program did not come from one
    model: str = ""  # the program's author; empty for a person
    program: str = ""
    problems: tuple[str, ...] = ()  # sentences from the check
    reason: str = ""  # why it is in its state
    line: int | None = None  # the program's line at which it ended
    ended: float | None = None  # seconds since 1970
    if_tool_dies: str = ""  # what the robot does if CodeBotler ends unexpectedly

    @property
    def has_ended(self) -> bool:
        """Whether its state is final."""
        return self.state.is_final

    @classmethod
    def read(cls, folder: Path) -> MissionSummary:
        """Read the summary of a mission; raises UserError if it is damaged."""
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
        """Replace the file in one step."""
        write_whole(folder / SUMMARY_FILE, json.dumps(asdict(self), indent=1).encode())


def open_log(folder: Path) -> Appender:
    """Open and lock the log of a mission; raises BlockingIOError if another process has it open."""
    return Appender(folder / EVENTS_FILE, exclusive=True)


def add_event(log: Appender, event: str, clock: float, **data: object) -> LogLine:
    """Write an event with the current time, and return it."""
    line = {"time": round(time.time(), 6), "clock": round(clock, 6), "event": event, **data}
    log.append(to_line(line))
    return line


def read_events(folder: Path) -> list[LogLine]:
    """Read the events of a mission, except a torn last line; raises UserError if a line is no event."""
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
"""The kinds of events that end a skill."""


def find_unfinished_skill(events: Iterable[LogLine]) -> LogLine | None:
    """Return the event of the last skill that has not ended, if any."""
    going: LogLine | None = None
    for line in events:
        if line["event"] == "skill":
            going = line
        elif line["event"] in SKILL_END_EVENTS:
            going = None
    return going
