"""The rules by which programs are simulated; a suite chooses them, a robot needs none."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Literal, TypeAlias

Matching: TypeAlias = Literal["label-in-request", "whole-words"]


@dataclass(frozen=True)
class Limits:
    """What one run may spend before it ends with status `timeout`."""

    seconds: float = 3600.0  # simulated
    calls: int = 1_000  # of skills; sleeping is none
    ticks: int = 200_000  # fuel: turns of loops and entries of functions
    text: int = 10_000  # characters of one text that a skill is given
    trace: int = 1_000_000  # characters of all texts of a trace


@dataclass(frozen=True)
class Rules:
    """How a suite wants its worlds simulated; the defaults are those of the paper's suite.

    Args:
        literals: `lowercase` lowers the string literals of a program before the run, as the authors of the
            paper did; `as-written` is what a robot does.
        matching: how a request finds a room, an object or a person: if the label is found anywhere in it
            (`label-in-request`), or as whole words, in the singular or the plural (`whole-words`).
        people: who answers to which name: everybody to any (`answer-to-any-name`), or each to their own and
            to a word for people, as well as to no name at all (`own-name-or-word`).
        words_for_people: regexes of the words for people, for `own-name-or-word`.
        words_for_yes: regexes of what else an option may say that means yes, for people who answer `yes`.
        words_for_no: the same for `no`. An option in which one of them is found is never a yes; and a single
            option that says neither is what who answers yes chooses.
        events: whether drives, picks and places are recorded by the words of the request (`as-requested`), or
            by the room that was reached and the thing that was moved (`as-happened`). A drive that reaches no
            room is then no event.
        limits: what a run may spend.
        clock_starts: what the program's clock shows when the run starts.
    """

    literals: Literal["lowercase", "as-written"] = "lowercase"
    matching: Matching = "label-in-request"
    people: Literal["answer-to-any-name", "own-name-or-word"] = "answer-to-any-name"
    words_for_people: tuple[str, ...] = ()
    words_for_yes: tuple[str, ...] = ()
    words_for_no: tuple[str, ...] = ()
    events: Literal["as-requested", "as-happened"] = "as-requested"
    limits: Limits = field(default_factory=Limits)
    clock_starts: datetime = datetime(2024, 1, 1, 12, tzinfo=UTC)


PAPER = Rules()
ENDLESS = Limits(calls=10**12, trace=10**12)  # on a robot, where each skill refuels the program
