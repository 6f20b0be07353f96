"""Automata that read a trace from the left and know at each event whether a formula holds so far."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias, assert_never

from codebotler.core.cachedproperty import cached_property
from codebotler.rtl.formula import (
    ActAtFirst,
    ActAtSome,
    And,
    AtLeast,
    Count,
    EventPattern,
    Exists,
    Formula,
    Not,
    Or,
    Scope,
)

MOST_STATES = 1_000
"""States that an automaton may have before it is made as small as possible."""

State: TypeAlias = Hashable
Letter: TypeAlias = frozenset[EventPattern]
"""The elements of a formula that match an event."""


class Undecided(Exception):  # noqa: N818 - no mistake of the caller
    """An answer would take too many states to find."""


@dataclass(frozen=True)
class Automaton:
    """The smallest deterministic automaton of a formula; it starts in state 0.

    Args:
        rows: for each state, where each letter leads.
        accepts: for each state, whether the formula holds if the trace ends there.
    """

    rows: tuple[tuple[int, ...], ...]
    accepts: tuple[bool, ...]

    @classmethod
    @lru_cache(maxsize=1_000)  # worlds of a task have most requirements in common
    def of(cls, formula: Formula, letters: tuple[Letter, ...]) -> Automaton:
        """The automaton of a formula, reading these letters.

        Raises:
            Undecided: it has too many states.
        """
        machine = _machine(formula)
        number: dict[State, int] = {machine.start: 0}
        rows: list[list[int]] = []
        states = [machine.start]
        for state in states:  # which grows meanwhile
            after = [machine.step(state, letter) for letter in letters]
            states += [one for one in dict.fromkeys(after) if one not in number]
            number.update((one, index) for index, one in enumerate(states[len(number) :], len(number)))
            rows.append([number[one] for one in after])
            if len(states) > MOST_STATES:
                raise Undecided
        return cls._smallest(rows, [machine.accepts(state) for state in states])

    @classmethod
    def _smallest(cls, rows: list[list[int]], accepts: list[bool]) -> Automaton:
        """Merge states until no two behave alike (Moore's algorithm)."""
        groups, before = [int(accepted != accepts[0]) for accepted in accepts], 0
        while len(set(groups)) != before:
            before = len(set(groups))
            behaviours = [(groups[state], *(groups[to] for to in row)) for state, row in enumerate(rows)]
            number = {behaviour: index for index, behaviour in enumerate(dict.fromkeys(behaviours))}
            groups = [number[behaviour] for behaviour in behaviours]
        firsts = [groups.index(group) for group in range(before)]
        return cls(
            tuple(tuple(groups[to] for to in rows[s]) for s in firsts), tuple(accepts[s] for s in firsts)
        )

    @cached_property
    def distances(self) -> tuple[int | None, ...]:
        """For each state, how many events acceptance is away; None where it is out of reach."""
        found: list[int | None] = [0 if accepted else None for accepted in self.accepts]
        distance, border = 0, {s for s, accepted in enumerate(self.accepts) if accepted}
        while border:
            distance += 1
            border = {s for s, row in enumerate(self.rows) if found[s] is None and border.intersection(row)}
            for state in border:
                found[state] = distance
        return tuple(found)


class _Machine(NamedTuple):
    """An automaton before its states are numbered."""

    start: State
    step: Callable[[Any, Letter], State]
    accepts: Callable[[Any], bool]


def _machine(formula: Formula) -> _Machine:
    match formula:
        case And(parts) | Or(parts):
            return _together([*map(_machine, parts)], all if isinstance(formula, And) else any)
        case Not(part):
            start, step, accepts = _machine(part)
            return _Machine(start, step, lambda state: not accepts(state))
        case ActAtFirst():
            arrival, departure = formula.stay.arrival, formula.stay.departure
            stay = (*formula.cuts, Scope("AfterFirst", arrival), Scope("BeforeFirst", departure))
            return _machine(And((Exists(arrival, formula.cuts), Exists(formula.element, stay))))
        case ActAtSome():
            machine = _during_stays(formula)
        case Exists(element):
            machine = _counter(element, 1, 1)
        case AtLeast(element, number):
            machine = _counter(element, number, number)
        case Count(element, number):
            machine = _counter(element, number, number + 1)
        case _:
            assert_never(formula)
    for cut in reversed(formula.cuts):
        machine = _behind(cut, machine)
    return machine


def _together(machines: Sequence[_Machine], join: Callable[[list[bool]], bool]) -> _Machine:
    return _Machine(
        tuple(machine.start for machine in machines),
        lambda state, letter: tuple(m.step(s, letter) for m, s in zip(machines, state, strict=True)),
        lambda state: join([m.accepts(s) for m, s in zip(machines, state, strict=True)]),
    )


def _counter(element: EventPattern, number: int, most: int) -> _Machine:
    return _Machine(0, lambda n, letter: min(n + (element in letter), most), lambda n: n == number)


def _during_stays(test: ActAtSome) -> _Machine:
    arrival, departure = test.stay.arrival, test.stay.departure

    def step(state: str, letter: Letter) -> State:
        stays = state == "there" and departure not in letter
        if state == "done" or (stays and test.element in letter):
            return "done"
        return "there" if stays or arrival in letter else "away"

    return _Machine("away", step, lambda state: state == "done")


def _behind(cut: Scope, inner: _Machine) -> _Machine:
    """The machine that lets an inner one read only what a cut leaves: everything where it finds nothing."""
    at, (start, step, accepts) = cut.element, inner
    match cut.name:
        case "BeforeFirst":  # whether the event has come, and the inner state
            return _Machine(
                (False, start),
                lambda s, letter: (True, s[1]) if s[0] or at in letter else (False, step(s[1], letter)),
                lambda s: accepts(s[1]),
            )
        case "AfterFirst":
            return _Machine(
                (False, start),
                lambda s, letter: (True, start) if not s[0] and at in letter else (s[0], step(s[1], letter)),
                lambda s: accepts(s[1]),
            )
        case "BeforeLast":  # the inner state, and the one in which the event was met last
            return _Machine(
                (start, ()),
                lambda s, letter: (step(s[0], letter), (s[0],) if at in letter else s[1]),
                lambda s: accepts(s[1][0] if s[1] else s[0]),
            )
        case "AfterLast":
            return _Machine(start, lambda s, letter: start if at in letter else step(s, letter), accepts)
    assert_never(cut.name)
