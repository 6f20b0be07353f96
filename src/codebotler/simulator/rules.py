"""The rules by which programs are simulated; a suite chooses them, a robot needs none."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Literal


@dataclass(frozen=True)
class Limits:
    """What one run may spend before it ends with status `timeout`.

    Args:
        seconds: simulated seconds.
        calls: skill calls; sleeping is none.
        ticks: turns of loops and entries of functions.
        text: characters of one text that a skill is given.
        trace: characters of all texts of a trace.
    """

    seconds: float = 3600.0
    calls: int = 1_000
    ticks: int = 200_000
    text: int = 10_000
    trace: int = 1_000_000


@dataclass(frozen=True)
class Rules:
    """How a suite wants its worlds simulated; the defaults are those of the paper's suite.

    Args:
        literals: `lowercase` lowers the string literals of a program before the run, as the authors of the
            paper did; `as-written` is what a robot does.
        matching: how a request finds a room, an object or a person.
        people: who answers to which name.
        limits: what a run may spend.
        clock_starts: what the program's clock shows when the run starts.
    """

    literals: Literal["lowercase", "as-written"] = "lowercase"
    matching: Literal["label-in-request"] = "label-in-request"
    people: Literal["answer-to-any-name"] = "answer-to-any-name"
    limits: Limits = field(default_factory=Limits)
    clock_starts: datetime = datetime(2024, 1, 1, 12, tzinfo=UTC)


PAPER = Rules()
"""The rules of the paper's suite."""

ENDLESS = Limits(calls=10**12, trace=10**12)
"""For a run on a robot, where time has no limit and ticks are counted from one skill to the next."""
