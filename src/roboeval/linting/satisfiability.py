"""Decides what formulas allow: whether some sequence of events satisfies them, and what they imply.

A formula is made into a finite automaton that reads events, and the product of automata is searched to its
end. So an answer is a proof for all sequences, of any length, of the *representative events*. These stand for
the ways in which the regexes of the formulas can be found, or not found, in one text; they are sampled, and
that is the one gap: a text that no sample is like. Options that are no text play no part.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain, count
from operator import getitem
from typing import Any, TypeAlias, assert_never

from codebotler.cachedproperty import cached_property
from codebotler.rtl import (
    ActAtFirst,
    ActAtSome,
    And,
    AtLeast,
    Count,
    Cut,
    Element,
    Exists,
    Formula,
    Not,
    Or,
    Test,
    holds,
)
from codebotler.trace import Event, Trace
from roboeval.linting.alphabet import Matches, elements, fits, representative_events

MOST_STATES = 1_000
"""How many states one automaton may have before it is made as small as can be."""

MOST_VISITED = 20_000
"""How many states of a product are visited."""


States: TypeAlias = tuple[int, ...]
"""One state of each automaton of a product."""


class Undecided(Exception):  # noqa: N818 - no mistake of the caller
    """More states would have to be visited than there is time for."""


class Reasoner:
    """Answers questions about formulas that are judged together.

    Args:
        formulas: all that will be asked about; their regexes make the representative events.
        moves: the requests by which the robot moves; by default any text, which may name several rooms at
            once, or none that there is, and may lead anywhere.
        leads: where each of these moves leads; by default to a room of its own.
        start: the room in which the robot starts, where moves are given.
    """

    def __init__(
        self,
        formulas: Iterable[Formula],
        moves: Iterable[str] | None = None,
        leads: Mapping[str, str] | None = None,
        start: str = "",
    ) -> None:
        wanted = [*chain.from_iterable(map(elements, formulas))]
        self._driving = None
        if moves is None:
            self.events = representative_events(wanted)
        else:
            to = {move: (leads or {}).get(move, move) for move in moves}
            rooms = [*dict.fromkeys([start, *to.values()])]
            self.events = [e for e in representative_events(wanted, rooms) if e.kind != "goto"]
            self.events += [Event("goto", move) for move in to]
            if any(element.place is not None for element in wanted):
                self._driving = _driving(self.events, rooms, to)
        self._readings: dict[Formula, tuple[Automaton, tuple[int, ...]]] = {}
        self._matches: Matches = cache(lambda wanted, text: wanted.matches(text))

    def clash(self, formulas: Sequence[Formula], denied: Formula | None = None) -> tuple[Formula, ...] | None:
        """Formulas that cannot all hold, or cannot while another fails; none of them can be left out.

        It starts with no formula and adds one that the last trace breaks, so that proofs stay small.

        Args:
            formulas: those that may be in it.
            denied: what must fail; then they imply it.

        Returns:
            the clashing formulas, in their order; None where a trace shows that there is no clash.

        Raises:
            Undecided: there are too many states.
        """
        wanted = set(elements(denied)) if denied else set()
        nearest = sorted(formulas, key=lambda one: -len(wanted & set(elements(one))))
        chosen: list[Formula] = []
        while (trace := self.trace(chosen, denied)) is not None:
            broken = next((one for one in nearest if not holds(one, trace)), None)
            if broken is None:
                return None
            chosen.append(broken)
        for one in tuple(chosen):
            fewer = [other for other in chosen if other != one]
            if self.trace(fewer, denied) is None:
                chosen = fewer
        return tuple(one for one in formulas if one in chosen)

    def trace(self, formulas: Sequence[Formula], denied: Formula | None = None) -> Trace | None:
        """A trace of representative events on which formulas hold and another fails; None if there is none.

        Args:
            formulas: what must hold.
            denied: what must fail.

        Raises:
            Undecided: there are too many states.
        """
        readings = [self._reading(one) for one in formulas]
        if denied is not None:
            automaton, letters = self._reading(denied)
            readings.append((automaton.complement, letters))
        if self._driving is not None:
            readings.append(self._driving)
        # Events that no automaton tells apart are one letter of their product.
        of_events = [*zip(*(letters for _, letters in readings), strict=True)]
        alphabet = dict(zip(of_events, self.events, strict=False))
        # The first of those that are alike.
        alphabet.update(zip(reversed(of_events), reversed(self.events), strict=False))
        return _path([automaton for automaton, _ in readings], alphabet)

    def _reading(self, formula: Formula) -> tuple[Automaton, tuple[int, ...]]:
        """The formula's automaton, and which of its letters each representative event is."""
        if formula not in self._readings:
            seen = [*dict.fromkeys(elements(formula))]
            letters = [frozenset(e for e in seen if fits(e, event, self._matches)) for event in self.events]
            number = {letter: index for index, letter in enumerate(dict.fromkeys(letters))}
            automaton = Automaton.of(_machine(formula), tuple(number))
            self._readings[formula] = automaton, tuple(number[letter] for letter in letters)
        return self._readings[formula]


def _driving(
    events: Sequence[Event], rooms: Sequence[str], moves: Mapping[str, str]
) -> tuple[Automaton, tuple[int, ...]]:
    """What accepts the traces in which each event happens where the robot is, and how it reads the events."""
    lost = len(rooms)
    letters: dict[tuple[str, str], int] = {}
    kinds = [(event.text if event.kind == "goto" else "", event.place) for event in events]
    reading = tuple(letters.setdefault(kind, len(letters)) for kind in kinds)

    def after(here: int, move: str, place: str) -> int:
        if move:
            return rooms.index(moves[move])
        return here if rooms[here] == place else lost

    rows = [tuple(after(here, *kind) for kind in letters) for here in range(lost)]
    rows.append((lost,) * len(letters))
    return Automaton(tuple(rows), (*(True for _ in rooms), False)), reading


def _path(automata: Sequence[Automaton], alphabet: Mapping[tuple[int, ...], Event]) -> Trace | None:
    """Events that lead all automata to acceptance, found by going first where acceptance is nearest."""
    start = (0,) * len(automata)
    came: dict[States, tuple[States, Event] | None] = {start: None}
    tables = [automaton.rows for automaton in automata]
    nearness = [automaton.distances for automaton in automata]
    if None in map(getitem, nearness, start):
        return None
    steps = count()
    heap = [(0, 0, start)]
    while heap:
        _, _, state = heapq.heappop(heap)
        if not any(map(getitem, nearness, state)):
            return tuple(reversed([*_back(state, came)]))
        here = [*map(getitem, tables, state)]
        for letter, event in alphabet.items():
            after = (*map(getitem, here, letter),)
            if after in came:
                continue
            came[after] = state, event
            far = [*map(getitem, nearness, after)]
            if None not in far:
                heapq.heappush(heap, (sum(filter(None, far)), next(steps), after))
        if len(came) > MOST_VISITED:
            raise Undecided
    return None


def _back(state: States, came: Mapping[States, tuple[States, Event] | None]) -> Iterator[Event]:
    while (step := came[state]) is not None:
        state, event = step
        yield event


# --- automata

State: TypeAlias = Hashable
Letter: TypeAlias = frozenset[Element]
"""The elements that match an event."""


@dataclass(frozen=True)
class Automaton:
    """A smallest deterministic automaton; it starts in state 0.

    Args:
        rows: for each state, where each letter leads.
        accepts: for each state, whether the formula holds if the trace ends there.
    """

    rows: tuple[tuple[int, ...], ...]
    accepts: tuple[bool, ...]

    @classmethod
    def of(cls, machine: _Machine, letters: Sequence[Letter]) -> Automaton:
        """The automaton of a machine that reads these letters.

        Raises:
            Undecided: it has too many states.
        """
        number: dict[State, int] = {machine.start: 0}
        states, rows = [machine.start], []
        for state in states:
            row = []
            for letter in letters:
                after = machine.step(state, letter)
                if after not in number:
                    number[after] = len(states)
                    states.append(after)
                row.append(number[after])
            rows.append(row)
            if len(states) > MOST_STATES:
                raise Undecided
        return cls._smallest(rows, [machine.accepts(state) for state in states])

    @classmethod
    def _smallest(cls, rows: list[list[int]], accepts: list[bool]) -> Automaton:
        """Merge states until no two behave alike."""
        groups: list[int] = [int(a != accepts[0]) for a in accepts]
        while True:
            behaviours = [(groups[s], *(groups[t] for t in row)) for s, row in enumerate(rows)]
            number = {behaviour: index for index, behaviour in enumerate(dict.fromkeys(behaviours))}
            finer = [number[behaviour] for behaviour in behaviours]
            if len(number) == len(set(groups)):
                break
            groups = finer
        firsts = {group: state for state, group in reversed([*enumerate(finer)])}
        ordered = [firsts[group] for group in range(len(firsts))]
        return cls(
            tuple(tuple(finer[t] for t in rows[s]) for s in ordered), tuple(accepts[s] for s in ordered)
        )

    @cached_property
    def complement(self) -> Automaton:
        """The automaton of the negated formula."""
        return Automaton(self.rows, tuple(not accepted for accepted in self.accepts))

    @cached_property
    def distances(self) -> tuple[int | None, ...]:
        """For each state, how many events acceptance is away; None where it cannot be reached any more."""
        found: list[int | None] = [0 if accepted else None for accepted in self.accepts]
        distance, border = 0, {s for s, accepted in enumerate(self.accepts) if accepted}
        while border:
            distance += 1
            border = {s for s, row in enumerate(self.rows) if found[s] is None and border.intersection(row)}
            for state in border:
                found[state] = distance
        return tuple(found)


@dataclass(frozen=True)
class _Machine:
    """What reads a trace from the left, remembering only a state, and knows at each end whether it holds."""

    start: State
    step: Callable[[Any, Letter], State]
    accepts: Callable[[Any], bool]


def _machine(formula: Formula) -> _Machine:
    match formula:
        case And(parts):
            return _together([_machine(part) for part in parts], all)
        case Or(parts):
            return _together([_machine(part) for part in parts], any)
        case Not(part):
            inner = _machine(part)
            return _Machine(inner.start, inner.step, lambda state: not inner.accepts(state))
        case _:
            machine = _reader(formula)
            for cut in reversed(formula.cuts):
                machine = _behind(cut, machine)
            return machine


def _together(machines: list[_Machine], join: Callable[[Iterable[bool]], bool]) -> _Machine:
    return _Machine(
        tuple(machine.start for machine in machines),
        lambda state, letter: tuple(m.step(s, letter) for m, s in zip(machines, state, strict=True)),
        lambda state: join(m.accepts(s) for m, s in zip(machines, state, strict=True)),
    )


def _reader(test: Test) -> _Machine:
    element = test.element
    match test:
        case Exists():
            return _Machine(False, lambda seen, letter: seen or element in letter, bool)  # noqa: FBT003 - a state
        case AtLeast(_, number):
            return _counter(element, number, number)
        case Count(_, number):
            return _counter(element, number, number + 1)
        case ActAtFirst():
            return _at_first(test)
        case ActAtSome():
            return _at_some(test)
    assert_never(test)


def _counter(element: Element, number: int, most: int) -> _Machine:
    return _Machine(0, lambda n, letter: min(n + (element in letter), most), lambda n: n == number)


def _at_first(test: ActAtFirst) -> _Machine:
    arrival, departure = test.stay.arrival, test.stay.departure

    def step(state: str, letter: Letter) -> State:
        match state:
            case "before":
                return "there" if arrival in letter else state
            case "there" if departure in letter:
                return "gone"
            case "there" if test.element in letter:
                return "done"
        return state

    return _Machine("before", step, lambda state: state == "done")


def _at_some(test: ActAtSome) -> _Machine:
    arrival, departure = test.stay.arrival, test.stay.departure

    def step(state: str, letter: Letter) -> State:
        stays = state == "there" and departure not in letter
        if state == "done" or (stays and test.element in letter):
            return "done"
        return "there" if stays or arrival in letter else "away"

    return _Machine("away", step, lambda state: state == "done")


def _behind(cut: Cut, inner: _Machine) -> _Machine:
    """The machine that lets an inner one read only what a cut leaves: everything where it finds nothing."""
    at = cut.element
    match cut.name:
        case "BeforeFirst":
            return _Machine(
                (False, inner.start),
                lambda s, letter: (True, s[1]) if s[0] or at in letter else (False, inner.step(s[1], letter)),
                lambda s: inner.accepts(s[1]),
            )
        case "AfterFirst":
            return _Machine(
                (False, inner.start),
                lambda s, letter: (
                    (True, inner.start) if not s[0] and at in letter else (s[0], inner.step(s[1], letter))
                ),
                lambda s: inner.accepts(s[1]),
            )
        case "BeforeLast":
            return _Machine(
                (inner.start, ()),
                lambda s, letter: (inner.step(s[0], letter), (s[0],) if at in letter else s[1]),
                lambda s: inner.accepts(s[1][0] if s[1] else s[0]),
            )
        case "AfterLast":
            return _Machine(
                inner.start,
                lambda s, letter: inner.start if at in letter else inner.step(s, letter),
                inner.accepts,
            )
    assert_never(cut.name)
