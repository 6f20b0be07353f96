"""Evaluate a formula on a run, one event at a time."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Any

from codebotler.core.trace import Event
from codebotler.rtl import formulas
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.automaton import MAX_STATES, machine_of
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
        self._machine = machine = _shared_machine(formula)
        self._state: Any = machine.start
        self.holds = machine.accepts(self._state)
        self._seen = 0
        self._masks = None if events is None else frozenset(machine.mask(event, 0) for event in events)

    @property
    def is_final(self) -> bool | None:
        """Whether no further event can change `holds`; None without `events`, or if this is too complex."""
        if self._masks is None:
            return None
        possible, waiting = {self._state}, [self._state]
        for state in waiting:  # the list grows as the loop runs
            for after, holds in (self._machine.step(state, mask) for mask in self._masks):
                if holds != self.holds:
                    return False
                if after not in possible:
                    possible.add(after)
                    waiting.append(after)
            if len(waiting) > MAX_STATES:
                return None
        return True

    def feed(self, event: Event) -> bool:
        """Process the next event, and return whether the formula holds now.

        Raises:
            Inconclusive: an option on which the result depends is not a string. The event is ignored.
            ValueError: the event matches none of `events`, and is ignored.
        """
        mask = self._machine.mask(event, self._seen)
        if self._masks is not None and mask not in self._masks:
            raise ValueError(f"{event.kind} {event.text[:50]!r} is like none in the list of possible events")
        self._state, self.holds = self._machine.step(self._state, mask)
        self._seen += 1
        return self.holds

    def would_hold(self, event: Event) -> bool:
        """Whether the formula would hold after an event. Raise Inconclusive if that cannot be decided."""
        return self._machine.step(self._state, self._machine.mask(event, self._seen))[1]


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

    def mask(self, event: Event, at: int) -> int:
        found = 0
        for bit, element in self._by_kind.get(event.kind, ()):
            if is_match(element, event, at):
                found |= bit
        return found

    def step(self, state: Any, mask: int) -> tuple[Any, bool]:  # noqa: ANN401 - as in Machine
        """Return the state after an event, given the patterns it matches, and whether the formula holds."""
        known = self.steps.get((state, mask))
        if known is not None:
            return known
        letter = frozenset(one for bit, one in enumerate(self._elements) if mask >> bit & 1)
        after = self._machine.step(state, letter)
        found = after, self._machine.accepts(after)
        if len(self.steps) < MAX_CACHED_STEPS:
            self.steps[state, mask] = found
        return found


_shared_machine = lru_cache(maxsize=256)(_Machine)  # monitors of the same formula share its cached steps
