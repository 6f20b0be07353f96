"""Convert formulas to finite automata over the letters of an alphabet."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias, assert_never

from codebotler.core.cachedproperty import cached_property
from codebotler.rtl import formulas

MAX_STATES = 1_000  # the limit applies before minimization

AutomatonState: TypeAlias = Hashable
Letter: TypeAlias = frozenset[formulas.EventPattern]
"""The input of an automaton for one event: the set of the formula's patterns that match the event."""


class Undecided(Exception):  # noqa: N818 - not a mistake of the caller
    """Raised if the answer to a question would take too long to find."""


@dataclass(frozen=True)
class Automaton:
    """The minimal deterministic automaton of a formula, which starts in state 0."""

    rows: tuple[tuple[int, ...], ...]  # for each state, the next state for each letter
    accepts: tuple[bool, ...]  # for each state, whether the formula holds there

    @classmethod
    @lru_cache(maxsize=1_000)  # worlds of a task share most requirements
    def of(cls, formula: formulas.Formula, letters: tuple[Letter, ...]) -> Automaton:
        """Build a formula's minimal automaton over `letters`. Raise Undecided if it needs too many states."""
        machine = machine_of(formula)
        number: dict[AutomatonState, int] = {machine.start: 0}
        rows: list[list[int]] = []
        states = [machine.start]
        for state in states:  # the list grows as the loop runs
            after = [machine.step(state, letter) for letter in letters]
            states += [one for one in dict.fromkeys(after) if one not in number]
            number.update((one, index) for index, one in enumerate(states[len(number) :], len(number)))
            rows.append([number[one] for one in after])
            if len(states) > MAX_STATES:
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
        merged = (tuple(groups[to] for to in rows[state]) for state in firsts)
        return cls(tuple(merged), tuple(accepts[state] for state in firsts))

    @cached_property
    def always(self) -> Automaton:
        """The automaton of the traces for which the formula holds at the start and after every event."""
        rows = tuple(
            row if accepted else (state,) * len(row)
            for state, (row, accepted) in enumerate(zip(self.rows, self.accepts, strict=True))
        )
        return Automaton(rows, self.accepts)

    @cached_property
    def distances(self) -> tuple[int | None, ...]:
        """For each state, after how many events the formula can first hold; None if it never can."""
        found: list[int | None] = [0 if accepted else None for accepted in self.accepts]
        distance, border = 0, {s for s, accepted in enumerate(self.accepts) if accepted}
        while border:
            distance += 1
            border = {s for s, row in enumerate(self.rows) if found[s] is None and border.intersection(row)}
            for state in border:
                found[state] = distance
        return tuple(found)


class Machine(NamedTuple):
    """An automaton whose states are computed as they are needed."""

    start: AutomatonState
    step: Callable[[Any, Letter], AutomatonState]
    accepts: Callable[[Any], bool]


def machine_of(formula: formulas.Formula) -> Machine:
    """Build an automaton of a formula that computes each state only when it is reached."""
    match formula:
        case formulas.And(parts) | formulas.Or(parts):
            return _together([*map(machine_of, parts)], all if isinstance(formula, formulas.And) else any)
        case formulas.Not(part):
            start, step, accepts = machine_of(part)
            return Machine(start, step, lambda state: not accepts(state))
        case formulas.ActAtFirst(_, element):
            return machine_of(formulas.Exists(element, formula.stay))
        case formulas.ActAtSome():
            machine = _during_stays(formula)
        case formulas.Exists(element):
            machine = _counter(element, 1, 1)
        case formulas.Last(element):
            machine = Machine(0, lambda _, letter: int(element in letter), bool)
        case formulas.AtLeast(element, number):
            machine = _counter(element, number, number)
        case formulas.Count(element, number):
            machine = _counter(element, number, number + 1)
        case _:
            assert_never(formula)
    for scope in reversed(formula.scopes):
        machine = _within(scope, machine)
    return machine


def _together(machines: Sequence[Machine], join: Callable[[list[bool]], bool]) -> Machine:
    return Machine(
        tuple(machine.start for machine in machines),
        lambda state, letter: tuple(m.step(s, letter) for m, s in zip(machines, state, strict=True)),
        lambda state: join([m.accepts(s) for m, s in zip(machines, state, strict=True)]),
    )


def _counter(element: formulas.EventPattern, number: int, most: int) -> Machine:
    return Machine(0, lambda n, letter: min(n + (element in letter), most), lambda n: n == number)


def _during_stays(test: formulas.ActAtSome) -> Machine:
    def step(state: str, letter: Letter) -> AutomatonState:
        stays = state == "there" and test.departure not in letter
        if state == "done" or (stays and test.element in letter):
            return "done"
        return "there" if stays or test.arrival in letter else "away"

    return Machine("away", step, lambda state: state == "done")


def _within(scope: formulas.Scope, inner: Machine) -> Machine:
    """Restrict a machine to the events in a scope. A state is (whether the bound was seen, inner state)."""
    at, (start, step, accepts) = scope.element, inner
    which = scope.name.removeprefix("Only")
    if which == "BeforeLast":
        return _before_last(scope, inner)

    def read(state: Any, letter: Letter) -> AutomatonState:  # noqa: ANN401 - as in Machine
        came, here = state
        if which == "BeforeFirst":
            return (True, here) if came or at in letter else (False, step(here, letter))
        begins = at in letter and not (came and which == "AfterFirst")
        return (True, start) if begins else (came, step(here, letter))

    def accepted(state: Any) -> bool:  # noqa: ANN401 - as in Machine
        came, here = state
        return accepts(start if scope.is_only and not came else here)

    return Machine((False, start), read, accepted)


def _before_last(scope: formulas.Scope, inner: Machine) -> Machine:
    """Restrict a machine to the events before the last bound. Its states include the inner state there."""
    at, (start, step, accepts) = scope.element, inner
    nothing = (start,) if scope.is_only else ()
    return Machine(
        (start, nothing),
        lambda s, letter: (step(s[0], letter), (s[0],) if at in letter else s[1]),
        lambda s: accepts(s[1][0] if s[1] else s[0]),
    )
