"""Events, traces and outcomes: what a robot did, and how a run of a program ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TypeAlias


@dataclass(frozen=True)
class Option:
    """One choice offered with a question.

    Args:
        text: the option as text.
        is_text: False where the program offered something else, such as a number; RTL refuses to judge it.
    """

    text: str
    is_text: bool = True


@dataclass(frozen=True)
class Event:
    """One executed skill.

    Args:
        kind: goto, say, ask, check, pick or place, or the kind of a further skill.
        text: the program's request, without spaces at its ends.
        options: what a question offered; empty for other kinds.
        answer: the text of the chosen option; None without an answer, and for other kinds.
        found: the result of a look; None for other kinds.
        place: the room where it happened, as the world names it (for a drive, the room where it started).
        time: simulated seconds since the start of the run.
    """

    kind: str
    text: str
    options: tuple[Option, ...] = ()
    answer: str | None = None
    found: bool | None = None
    place: str = field(default="", compare=False)
    time: float = field(default=0.0, compare=False)


Trace: TypeAlias = tuple[Event, ...]
"""The events of one run, in the order in which they happened."""


class Status(StrEnum):
    """How a run ended."""

    FINISHED = "finished"
    TIMEOUT = "timeout"
    PYTHON_ERROR = "python-error"
    ROBOT_ERROR = "robot-error"
    KILLED = "killed"


@dataclass(frozen=True)
class RunError:
    """Why a run did not finish.

    Args:
        kind: an exception's class, a kind of robot error, TimeoutError, MemoryError, Crash or ForbiddenCall.
        message: one sentence.
    """

    kind: str
    message: str


@dataclass(frozen=True)
class Outcome:
    """How a run of a program in a world ended, and what the robot did until then.

    Args:
        status: how it ended.
        trace: what the robot did.
        error: None exactly when the status is finished.
        line: the line of the program at which it ended, counted from 1; None where there is none.
    """

    status: Status
    trace: Trace = field(repr=False)
    error: RunError | None = None
    line: int | None = None
