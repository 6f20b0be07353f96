"""`Monitor`: whether a formula is true of what has happened so far, one event at a time."""

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

MOST_REMEMBERED_STEPS = 4_000  # that are remembered of a formula


class Monitor:
    """Tells after each event whether a formula holds on all events so far.

    Each event takes the same time and the same memory, however many there were. With `events`, the monitor
    also knows whether that is for good, whichever of these events may follow.

    Args:
        formula: what to watch.
        events: all that can happen, as far as the formula tells events apart; None for anything.

    `holds` says whether the formula is true of the events so far.
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
        """What counts of the past: monitors of one formula with equal states say the same from now on."""
        return self._state

    @property
    def is_final(self) -> bool | None:
        """Whether no events can change that; None if `events` are not given, or it would take too long."""
        return None if self._future is None else self._future.is_final

    def feed(self, event: Event) -> bool:
        """Take the next event, and return whether the formula holds now.

        Raises:
            Inconclusive: an option is no text; the event does not count.
            ValueError: the event is not one of `events`; it does not count.
        """
        mask = self._machine.mask(event, self._seen)
        if self._future is not None:
            self._future.step(self._machine.letter(mask))
        known = self._machine.steps.get((self._state, mask))
        self._state, self.holds = known or self._machine.step(self._state, mask)
        self._seen += 1
        return self.holds

    def would_hold(self, event: Event) -> bool:
        """Whether the formula would hold if this came next; Inconclusive if an option of it is no text."""
        machine = self._machine
        mask = machine.mask(event, self._seen)
        return (machine.steps.get((self._state, mask)) or machine.step(self._state, mask))[1]


class _Machine:
    """The automaton of a formula, which remembers steps; shared by all monitors of the formula.

    Letters are numbers, with a bit for each element of the formula that matches.
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
        """That of a formula."""
        return cls(formula)

    def mask(self, event: Event, at: int) -> int:
        """The letter of an event."""
        wanted = self._by_kind.get(event.kind)
        if wanted is None:  # which is so for most rules and events
            return 0
        found = 0
        for bit, element in wanted:
            if is_match(element, event, at):
                found |= bit
        return found

    def letter(self, mask: int) -> Letter:
        """The elements of a letter."""
        return frozenset(one for bit, one in enumerate(self._elements) if mask >> bit & 1)

    def step(self, state: Any, mask: int) -> tuple[Any, bool]:  # noqa: ANN401 - as in Machine
        """The state after a letter, and whether the formula holds there."""
        after = self._machine.step(state, self.letter(mask))
        found = after, self._machine.accepts(after)
        if len(self.steps) < MOST_REMEMBERED_STEPS:
            self.steps[state, mask] = found
        return found


class _Future:
    """What may still become of a formula when events are of certain letters."""

    def __init__(self, automaton: Automaton, letters: tuple[Letter, ...]) -> None:
        self._automaton, self._letters = automaton, letters
        self._opposite = replace(automaton, accepts=tuple(not accepted for accepted in automaton.accepts))
        self._state = 0

    @classmethod
    def of(cls, formula: formulas.Formula, letters: Iterable[Letter]) -> _Future | None:
        """That of a formula at the start; None if it would take too long to find."""
        different = tuple(dict.fromkeys(letters))
        try:
            return cls(Automaton.of(formula, different), different)
        except Undecided:
            return None

    @property
    def is_final(self) -> bool:
        """Whether the formula is true, or false, whatever comes."""
        return None in {self._automaton.distances[self._state], self._opposite.distances[self._state]}

    def step(self, letter: Letter) -> None:
        """Go on by an event."""
        if letter not in self._letters:
            raise ValueError("this event is not one of those that can happen")
        self._state = self._automaton.rows[self._state][self._letters.index(letter)]
