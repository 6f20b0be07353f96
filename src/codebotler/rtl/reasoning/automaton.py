"""Formulas as finite automata over the letters of an alphabet."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias, assert_never

from codebotler.core.cachedproperty import cached_property
from codebotler.rtl import formulas

MOST_STATES = 1_000
"""States that an automaton may have before it is minimized."""

State: TypeAlias = Hashable
Letter: TypeAlias = frozenset[formulas.EventPattern]
"""The elements of a formula that match an event."""


class Undecided(Exception):  # noqa: N818 - no mistake of the caller
    """The answer to a question would take too long to find."""


@dataclass(frozen=True)
class Automaton:
    """The smallest deterministic automaton of a formula; it starts in state 0."""

    rows: tuple[tuple[int, ...], ...]  # for each state, where each letter leads
    accepts: tuple[bool, ...]  # for each state, whether the formula holds if the trace ends there

    @classmethod
    @lru_cache(maxsize=1_000)  # worlds of a task have most requirements in common
    def of(cls, formula: formulas.Formula, letters: tuple[Letter, ...]) -> Automaton:
        """The automaton of a formula, reading these letters."""
        machine = _machine(formula)
        number: dict[State, int] = {machine.start: 0}
        rows: list[list[int]] = []
        states = [machine.start]
        for state in states:  # the list grows as the loop runs
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
        """For each state, the fewest events to an accepting one; None if none can be reached."""
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


def _machine(formula: formulas.Formula) -> _Machine:
    match formula:
        case formulas.And(parts) | formulas.Or(parts):
            return _together([*map(_machine, parts)], all if isinstance(formula, formulas.And) else any)
        case formulas.Not(part):
            start, step, accepts = _machine(part)
            return _Machine(start, step, lambda state: not accepts(state))
        case formulas.ActAtFirst():
            arrival = formula.arrival
            stay = (
                *formula.scopes,
                formulas.Scope("AfterFirst", arrival),
                formulas.Scope("BeforeFirst", formula.departure),
            )
            return _machine(
                formulas.And(
                    (formulas.Exists(arrival, formula.scopes), formulas.Exists(formula.element, stay))
                )
            )
        case formulas.ActAtSome():
            machine = _during_stays(formula)
        case formulas.Exists(element):
            machine = _counter(element, 1, 1)
        case formulas.AtLeast(element, number):
            machine = _counter(element, number, number)
        case formulas.Count(element, number):
            machine = _counter(element, number, number + 1)
        case _:
            assert_never(formula)
    for scope in reversed(formula.scopes):
        machine = _within(scope, machine)
    return machine


def _together(machines: Sequence[_Machine], join: Callable[[list[bool]], bool]) -> _Machine:
    return _Machine(
        tuple(machine.start for machine in machines),
        lambda state, letter: tuple(m.step(s, letter) for m, s in zip(machines, state, strict=True)),
        lambda state: join([m.accepts(s) for m, s in zip(machines, state, strict=True)]),
    )


def _counter(element: formulas.EventPattern, number: int, most: int) -> _Machine:
    return _Machine(0, lambda n, letter: min(n + (element in letter), most), lambda n: n == number)


def _during_stays(test: formulas.ActAtSome) -> _Machine:
    def step(state: str, letter: Letter) -> State:
        stays = state == "there" and test.departure not in letter
        if state == "done" or (stays and test.element in letter):
            return "done"
        return "there" if stays or test.arrival in letter else "away"

    return _Machine("away", step, lambda state: state == "done")


def _within(scope: formulas.Scope, inner: _Machine) -> _Machine:
    """The machine that lets an inner one read only the events in a scope."""
    at, (start, step, accepts) = scope.element, inner
    match scope.name:
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
        case "BeforeLast":  # the inner state, and what it was when the event last came
            return _Machine(
                (start, ()),
                lambda s, letter: (step(s[0], letter), (s[0],) if at in letter else s[1]),
                lambda s: accepts(s[1][0] if s[1] else s[0]),
            )
        case "AfterLast":
            return _Machine(start, lambda s, letter: start if at in letter else step(s, letter), accepts)
    assert_never(scope.name)
