"""What a mission leaves on the disk: one line for each event as it happens, and a summary."""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.files import Appender, write_whole

EVENTS, SUMMARY = "events.jsonl", "mission.json"
TEXTS = ("id", "state", "robot", "instruction", "model", "program", "reason", "if_tool_dies")
HAS: Mapping[str, frozenset[str]] = {
    "state": frozenset({"state"}),
    "skill": frozenset({"number", "skill", "arguments"}),
    "feedback": frozenset({"number", "skill", "text"}),
    "result": frozenset({"number", "skill", "result"}),
    "error": frozenset({"number", "skill", "kind", "message"}),
    "cancelled": frozenset({"number", "skill"}),
    "picture": frozenset({"number", "skill"}),
    "late": frozenset({"number", "skill"}),
    "sleep": frozenset({"seconds"}),
    "stop": frozenset({"by"}),
    "log": frozenset({"text"}),
}
"""What belongs to each kind of event."""

Line: TypeAlias = dict[str, Any]
"""An event: `time` (seconds since 1970), `clock` (the robot's, in seconds), `event` (what kind), and more."""


@dataclass
class Summary:
    """A mission in short.

    Args:
        id: its name, by which it is found.
        state: as `codebotler.missions.mission` has them.
        robot: the kind of robot.
        created: seconds since 1970.
        instruction: what somebody asked for, if the program came from an instruction.
        model: who wrote the program, if a model did.
        program: its source.
        problems: what the check found, each in a sentence.
        reason: why it came to its state, in a sentence.
        line: of the program, at which it ended; None where there is none.
        ended: seconds since 1970; None while it goes on.
        if_tool_dies: what becomes of the robot then.
    """

    id: str
    state: str
    robot: str
    created: float
    instruction: str = ""
    model: str = ""
    program: str = ""
    problems: tuple[str, ...] = ()
    reason: str = ""
    line: int | None = None
    ended: float | None = None
    if_tool_dies: str = ""

    @classmethod
    def read(cls, folder: Path) -> Summary:
        """The summary of a mission.

        Raises:
            UserError: it is none.
            OSError: it cannot be read.
        """
        path = folder / SUMMARY
        try:
            data = json.loads(path.read_bytes())
            known = {field.name: data[field.name] for field in fields(cls) if field.name in data}
            summary = cls(**{**known, "problems": tuple(known.get("problems", ()))})
            datetime.fromtimestamp(summary.created, UTC)
            "".join((*summary.problems, *(getattr(summary, name) for name in TEXTS)))
        except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
            raise UserError("this is no summary of a mission; remove its folder", file=path) from None
        return summary

    def write(self, folder: Path) -> None:
        """Write it whole, or leave what was there.

        Raises:
            OSError: it cannot be written.
        """
        write_whole(folder / SUMMARY, json.dumps(asdict(self), indent=1).encode())


class Log:
    """The events of one mission; locked as long as this process has it open.

    Args:
        folder: of the mission.

    Raises:
        BlockingIOError: another process has it open.
        OSError: it cannot be opened.
    """

    def __init__(self, folder: Path) -> None:
        self._lock, self._lines = threading.Lock(), Appender(folder / EVENTS, exclusive=True)
        self.is_open = True

    def add(self, event: str, *, clock: float = 0.0, **data: object) -> Line:
        """Write one event; nothing once the log is closed.

        Args:
            event: what kind it is.
            clock: of the robot, in seconds since the start.
            data: what belongs to it, as JSON has it.

        Raises:
            OSError: it cannot be written.
        """
        with self._lock:
            line = {"time": round(time.time(), 6), "clock": round(clock, 6), "event": event, **data}
            if self.is_open:
                self._lines.append(json.dumps(line).encode() + b"\n")
        return line

    def close(self) -> None:
        """Give the log back."""
        with self._lock:
            if self.is_open:
                self.is_open = False
                self._lines.close()


def events_of(folder: Path) -> list[Line]:
    """The events of a mission, without a last line that was cut off.

    Raises:
        UserError: a line is no event.
        OSError: they cannot be read.
    """
    path = folder / EVENTS
    whole = path.read_bytes().split(b"\n")[:-1]
    return [_event(text, path, number) for number, text in enumerate(whole, 1)]


def _event(text: bytes, path: Path, number: int) -> Line:
    try:
        line = json.loads(text)
        has_all = HAS.get(line["event"], frozenset()) <= line.keys()
        if has_all and isinstance(line["event"], str) and 0 <= line["time"] + line["clock"] < math.inf:
            return dict(line)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        pass
    raise UserError("this is no event of a mission; remove the line", file=path, line=number)


def doing(events: Iterable[Line]) -> Line | None:
    """The skill that went on when the events broke off, if one did."""
    going: Line | None = None
    for line in events:
        if line["event"] == "skill":
            going = line
        elif line["event"] in {"result", "error", "cancelled", "late"}:
            going = None
    return going
