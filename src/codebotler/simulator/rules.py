"""The rules by which programs are simulated; a suite chooses them, a robot needs none."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Literal, TypeAlias

WORDS_FOR_PEOPLE = (
    *("person", "people", "human", "someone", "somebody", "anyone", "anybody", "everyone", "everybody"),
    *("visitor", "guest", "employee", "colleague", "coworker", "occupant"),
)

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
    """How a suite wants its worlds simulated; the defaults are those of the paper's suite."""

    # The string literals of a program are lowered before the run, as the authors of the paper did.
    literals: Literal["lowercase", "as-written"] = "lowercase"
    # A label of the world is looked for anywhere in a request, or as whole words in the singular or plural.
    matching: Matching = "label-in-request"
    # Everybody answers to any name, or each to their own, to a word for people, and to no name at all.
    people: Literal["answer-to-any-name", "own-name-or-word"] = "answer-to-any-name"
    words_for_people: tuple[str, ...] = ()  # regexes
    # Regexes of what else an option may say that means yes or no. An option in which a no is found is never a
    # yes, and people who answer yes choose a single option that says neither.
    words_for_yes: tuple[str, ...] = ()
    words_for_no: tuple[str, ...] = ()
    # Drives, picks and places are recorded in the words of the request, or by the room that was reached and
    # the thing that was moved; a drive that reaches no room is then no event.
    events: Literal["as-requested", "as-happened"] = "as-requested"
    limits: Limits = field(default_factory=Limits)
    clock_starts: datetime = datetime(2024, 1, 1, 12, tzinfo=UTC)  # what clocks show when the run starts


PAPER = Rules()
ENDLESS = Limits(calls=10**12, trace=10**12)  # on a robot, where each skill refuels the program
