"""Evaluate a formula on a run, one event at a time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Any

from codebotler.core.trace import Event
from codebotler.rtl import formulas
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.automaton import Automaton, Letter, Undecided, machine_of
from codebotler.rtl.semantics import is_match

MAX_CACHED_STEPS = 4_000  # for each formula


class Monitor:
    """Evaluates a formula on a growing trace, with the result for the events so far in `holds`.

    Each event takes constant time and memory. With `events`, the monitor also knows if the result is final.

    Args:
        formula: the formula.
        events: an example of every kind of event that the formula distinguishes; None to allow any event.
    """

    def __init__(self, formula: formulas.Formula, events: Iterable[Event] | None = None) -> None:
        self.formula = formula
        self._machine = machine = _Machine.of(formula)
        self._state: Any = machine.start
        self.holds = machine.accepts(self._state)
        self._seen = 0
        letters = None if events is None else [machine.letter(machine.mask(event, 0)) for event in events]
        self._future = None if letters is None else _Future.of(formula, letters)

    @property
    def state(self) -> object:
        """The state of the automaton, which determines the results for all later events."""
        return self._state

    @property
    def is_final(self) -> bool | None:
        """Whether the result is final; None without `events`, or if deciding this takes too long."""
        return None if self._future is None else self._future.is_final

    def feed(self, event: Event) -> bool:
        """Process the next event, and return whether the formula holds now.

        Raises:
            Inconclusive: an option is not a string. The event is ignored.
            ValueError: the event matches none of `events`, and is ignored.
        """
        mask = self._machine.mask(event, self._seen)
        if self._future is not None:
            self._future.step(self._machine.letter(mask))
        known = self._machine.steps.get((self._state, mask))
        self._state, self.holds = known or self._machine.step(self._state, mask)
        self._seen += 1
        return self.holds

    def would_hold(self, event: Event) -> bool:
        """Whether the formula would hold after an event; raise Inconclusive if an option is not a string."""
        machine = self._machine
        mask = machine.mask(event, self._seen)
        return (machine.steps.get((self._state, mask)) or machine.step(self._state, mask))[1]


class _Machine:
    """The automaton of a formula with cached steps, which all monitors of the formula share.

    A letter is a bit mask of the formula's patterns that match an event.
    """

    def __init__(self, formula: formulas.Formula) -> None:
        self._elements = tuple(dict.fromkeys(elements(formula)))
        self._by_kind: dict[str, list[tuple[int, formulas.EventPattern]]] = {}
        for bit, element in enumerate(self._elements):
            self._by_kind.setdefault(element.kind, []).append((1 << bit, element))
        self._machine = machine_of(formula)
        self.start, self.accepts = self._machine.start, self._machine.accepts
        self.steps: dict[tuple[Any, int], tuple[Any, bool]] = {}

    @classmethod
    @lru_cache(maxsize=256)
    def of(cls, formula: formulas.Formula) -> _Machine:
        return cls(formula)

    def mask(self, event: Event, at: int) -> int:
        wanted = self._by_kind.get(event.kind)
        if wanted is None:  # the usual case
            return 0
        found = 0
        for bit, element in wanted:
            if is_match(element, event, at):
                found |= bit
        return found

    def letter(self, mask: int) -> Letter:
        return frozenset(one for bit, one in enumerate(self._elements) if mask >> bit & 1)

    def step(self, state: Any, mask: int) -> tuple[Any, bool]:  # noqa: ANN401 - as in Machine
        after = self._machine.step(state, self.letter(mask))
        found = after, self._machine.accepts(after)
        if len(self.steps) < MAX_CACHED_STEPS:
            self.steps[state, mask] = found
        return found


class _Future:
    def __init__(self, automaton: Automaton, letters: tuple[Letter, ...]) -> None:
        self._automaton, self._letters = automaton, letters
        self._opposite = replace(automaton, accepts=tuple(not accepted for accepted in automaton.accepts))
        self._state = 0

    @classmethod
    def of(cls, formula: formulas.Formula, letters: Iterable[Letter]) -> _Future | None:
        """Return the start state for a formula, or None if building its automaton takes too long."""
        different = tuple(dict.fromkeys(letters))
        try:
            return cls(Automaton.of(formula, different), different)
        except Undecided:
            return None

    @property
    def is_final(self) -> bool:
        """Whether no further event can change the result."""
        return None in {self._automaton.distances[self._state], self._opposite.distances[self._state]}

    def step(self, letter: Letter) -> None:
        if letter not in self._letters:
            raise ValueError("the event is not in the monitor's list of possible events")
        self._state = self._automaton.rows[self._state][self._letters.index(letter)]
