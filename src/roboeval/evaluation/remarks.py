"""Describes runs that repeated steps until a limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from codebotler.core.phrases import phrase
from codebotler.core.trace import Event, Status, Trace
from codebotler.core.words import counted, elide_list

MIN_REPETITIONS = 3  # fewer repetitions are not called a cycle
MAX_CYCLE_STEPS = 100


def remarks_on(verdict: Mapping[str, Any], trace: Trace) -> list[str]:
    """Return sentences that help to explain a run beyond its failed checks."""
    if verdict["status"] != Status.TIMEOUT or (cycle := cycle_at_end(trace)) is None:
        return []
    more = " times: " if verdict.get("cut") is None else " times or more: "
    return [cycle.sentence.replace(" times: ", more, 1)]


@dataclass(frozen=True)
class Cycle:
    """A sequence of steps that is repeated at the end of a trace."""

    first: int  # the number of the first step, from 1
    steps: Trace  # the steps of one repetition
    times: int

    @property
    def sentence(self) -> str:
        """Return a sentence that says which steps were repeated, from where on, and how often."""
        those = "" if len(self.steps) == 1 else f"{counted(len(self.steps), 'step')} "
        deeds = ", ".join(elide_list([*(phrase(step, "base") for step in self.steps)]))
        return f"From step {self.first} on, it repeated {those}{self.times:,} times: {deeds}."


def cycle_at_end(trace: Trace) -> Cycle | None:
    """Return the cycle that covers most steps at the end of a trace, or None. Prefer short cycles."""
    numbers: dict[Event, int] = {}
    each = [numbers.setdefault(event, len(numbers)) for event in trace]
    most, found = 0, None
    for length in range(1, min(MAX_CYCLE_STEPS, len(each) // MIN_REPETITIONS) + 1):
        start = len(each) - length
        while start > 0 and each[start - 1] == each[start - 1 + length]:
            start -= 1
        covered = len(each) - start
        if covered >= MIN_REPETITIONS * length and covered > most:
            most, found = covered, Cycle(start + 1, trace[start : start + length], covered // length)
    return found
