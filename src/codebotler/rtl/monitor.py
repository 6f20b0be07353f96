"""`Monitor`: whether a formula is true of what has happened so far, one event at a time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from codebotler.core.trace import Event
from codebotler.rtl import formulas
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.automaton import Automaton, Letter, Undecided, machine_of
from codebotler.rtl.semantics import is_match


class Monitor:
    """Tells after each event whether a formula holds on all events so far.

    Each event takes the same time and the same memory, however many there were. With `events`, the monitor
    also knows whether that is for good, whichever of these events may follow.

    Args:
        formula: what to watch.
        events: all that can happen, as far as the formula tells events apart; None for anything.
    """

    def __init__(self, formula: formulas.Formula, events: Iterable[Event] | None = None) -> None:
        self.formula = formula
        self._elements = tuple(dict.fromkeys(elements(formula)))
        self._machine = machine_of(formula)
        self._state: Any = self._machine.start
        self._seen = 0
        self._future = None if events is None else _Future.of(formula, map(self._letter, events))

    @property
    def holds(self) -> bool:
        """Whether the formula is true of the events so far."""
        return self._machine.accepts(self._state)

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
        letter = self._letter(event)
        if self._future is not None:
            self._future.step(letter)
        self._state = self._machine.step(self._state, letter)
        self._seen += 1
        return self.holds

    def would_hold(self, event: Event) -> bool:
        """Whether the formula would hold if this came next; Inconclusive if an option of it is no text."""
        return self._machine.accepts(self._machine.step(self._state, self._letter(event)))

    def _letter(self, event: Event) -> Letter:
        return frozenset([one for one in self._elements if is_match(one, event, self._seen)])


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
