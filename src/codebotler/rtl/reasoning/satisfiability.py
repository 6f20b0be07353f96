"""Search for a trace on which several formulas hold.

The search covers the product of the formulas' automata, so the result "none" is a proof for all sequences of
events of the alphabet. It misses only texts that meet a combination of conditions which no text of the
alphabet meets. Options that are not texts are ignored.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, compress, count
from operator import getitem
from typing import TypeAlias

from codebotler.core.skills.kinds import GOTO
from codebotler.core.trace import Event, Trace
from codebotler.rtl.formulas import Formula, Not
from codebotler.rtl.reasoning.alphabet import alphabet, elements
from codebotler.rtl.reasoning.automaton import Automaton, Undecided
from codebotler.rtl.semantics import holds, is_match

MAX_VISITED_STATES = 20_000  # states of the product automaton in one search

Reading: TypeAlias = tuple[Automaton, list[int]]
"""An automaton, and for each event of the alphabet the index of the letter that the automaton reads."""


class Reasoner:
    """Answers questions about formulas, for a robot in any rooms or in the rooms of one world.

    Args:
        formulas: all formulas of later questions; their regexes determine the alphabet.
        moves: the room to which each request to move leads; by default any text may lead anywhere.
        start: the robot's first room; only used with `moves`.
    """

    def __init__(
        self, formulas: Iterable[Formula], moves: Mapping[str, str] | None = None, start: str = ""
    ) -> None:
        wanted = [*dict.fromkeys(chain.from_iterable(map(elements, formulas)))]
        rooms = None if moves is None else [*dict.fromkeys([start, *moves.values()])]
        events = alphabet(wanted, rooms, None if moves is None else [*moves])
        if moves is not None and all(event.kind != GOTO for event in events):
            events += [Event(GOTO, move) for move in moves]
        self.events = events
        self._matched = {element: [is_match(element, event, 0) for event in events] for element in wanted}
        self._readings: dict[Formula, Reading] = {}
        self._driving: Reading | None = None
        if moves is not None and rooms is not None and any(element.place is not None for element in wanted):
            self._driving = _driving_automaton(self.events, rooms, moves)

    def conflict(self, formulas: Sequence[Formula], denied: Formula | None = None) -> list[Formula] | None:
        """Return a minimal subset of formulas that contradict each other, in order, or None if all can hold.

        Args:
            formulas: the formulas that should hold.
            denied: a formula that should fail. If it cannot fail, the returned subset implies this formula.

        Raises:
            Undecided: the search would take too long.
        """
        # Add only formulas that the last trace breaks, so that the proofs stay small.
        given = [] if denied is None else [Not(denied)]
        wanted = {element for one in given for element in elements(one)}
        nearest = sorted(formulas, key=lambda one: -len(wanted.intersection(elements(one))))
        chosen: list[Formula] = []
        while (trace := self.trace([*chosen, *given])) is not None:
            broken = next((one for one in nearest if not holds(one, trace)), None)
            if broken is None:
                return None
            chosen.append(broken)
        for one in tuple(chosen):
            fewer = [other for other in chosen if other != one]
            if self.trace([*fewer, *given]) is None:
                chosen = fewer
        return [one for one in formulas if one in chosen]

    def trace(
        self, formulas: Iterable[Formula], *, always: Iterable[Formula] = (), shortest: bool = False
    ) -> Trace | None:
        """Return a trace, made of `self.events`, on which all formulas hold, or None if there is none.

        Args:
            formulas: the formulas that must hold.
            always: formulas that must hold at the start and after every event.
            shortest: whether the trace must have minimal length, which takes longer.

        Raises:
            Undecided: the search would take too long.
        """
        readings = [self._reading(one) for one in formulas]
        readings += [(machine.always, read) for machine, read in map(self._reading, always)]
        if self._driving is not None:
            readings.append(self._driving)
        letters: dict[States, Event] = {}  # the first of the events that all automata treat alike
        for event, *of_event in zip(self.events, *(numbers for _, numbers in readings), strict=True):
            letters.setdefault(tuple(of_event), event)
        return _search([automaton for automaton, _ in readings], letters, shortest=shortest)

    def _reading(self, formula: Formula) -> Reading:
        if formula not in self._readings:
            seen = [*dict.fromkeys(elements(formula))]
            rows = [*zip(*map(self._matched.__getitem__, seen), strict=True)]
            different = sorted(set(rows))  # so that the order does not depend on the events
            letters = tuple(frozenset(compress(seen, row)) for row in different)
            number = {row: index for index, row in enumerate(different)}
            self._readings[formula] = Automaton.of(formula, letters), [number[row] for row in rows]
        return self._readings[formula]


def _driving_automaton(events: Sequence[Event], rooms: Sequence[str], moves: Mapping[str, str]) -> Reading:
    """Build the automaton of the traces in which each event happens in the robot's current room."""
    lost = len(rooms)
    kinds = [(event.text if event.kind == GOTO else "", event.place) for event in events]
    number = {kind: index for index, kind in enumerate(dict.fromkeys(kinds))}
    rows = [
        tuple(
            lost
            if place not in {room, *([""] if move else [])}
            else rooms.index(moves[move])
            if move
            else here
            for move, place in number
        )
        for here, room in enumerate(rooms)
    ]
    automaton = Automaton((*rows, (lost,) * len(number)), (*(True for _ in rooms), False))
    return automaton, [number[kind] for kind in kinds]


States: TypeAlias = tuple[int, ...]
"""A state of the product automaton: one state of each automaton."""


def _search(
    automata: Sequence[Automaton], letters: Mapping[States, Event], *, shortest: bool
) -> Trace | None:
    """Find a trace that all automata accept: any one by greedy search, or a shortest one by A*."""
    tables = [automaton.rows for automaton in automata]
    distances = [automaton.distances for automaton in automata]
    start = (0,) * len(automata)
    came: dict[States, tuple[int, States, Event | None]] = {start: (0, start, None)}
    if None in map(getitem, distances, start):
        return None
    heap, order = [(0, 0, start)], count(1)
    while heap:
        _, _, state = heapq.heappop(heap)
        if not any(map(getitem, distances, state)):
            return tuple(reversed([*_path_back(state, came)]))
        steps = came[state][0] + 1
        here = [*map(getitem, tables, state)]
        for letter, event in letters.items():
            after = (*map(getitem, here, letter),)
            if after in came and (not shortest or came[after][0] <= steps):
                continue
            came[after] = steps, state, event
            far = [*map(getitem, distances, after)]
            if None not in far:
                left = [each or 0 for each in far]
                heapq.heappush(heap, (steps + max(left) if shortest else sum(left), next(order), after))
        if len(came) > MAX_VISITED_STATES:
            raise Undecided
    return None


def _path_back(state: States, came: Mapping[States, tuple[int, States, Event | None]]) -> Iterator[Event]:
    _, before, event = came[state]
    while event is not None:
        yield event
        _, before, event = came[before]
