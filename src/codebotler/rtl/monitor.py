"""Evaluate a formula on a run, one event at a time."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from codebotler.core.trace import Event
from codebotler.rtl import formulas
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.reasoning.automaton import machine_of
from codebotler.rtl.semantics import is_match

MAX_CACHED_STEPS = 4_000  # for each formula


class Monitor:
    """Evaluates a formula on a growing trace, with the result for the events so far in `holds`.

    Each event takes constant time and memory.
    """

    def __init__(self, formula: formulas.Formula) -> None:
        self.formula = formula
        self._machine = _Machine.of(formula)
        self._state: Any = self._machine.start
        self.holds = self._machine.accepts(self._state)
        self._seen = 0

    @property
    def state(self) -> object:
        """The state of the automaton, which determines the results for all later events."""
        return self._state

    def feed(self, event: Event) -> bool:
        """Process the next event, and return whether the formula holds now.

        Raises:
            Inconclusive: an option is not a string. The event is ignored.
        """
        self._state, self.holds = self._machine.step(self._state, event, self._seen)
        self._seen += 1
        return self.holds

    def would_hold(self, event: Event) -> bool:
        """Whether the formula would hold after an event; raise Inconclusive if an option is not a string."""
        return self._machine.step(self._state, event, self._seen)[1]


class _Machine:
    """The automaton of a formula with cached steps, which all monitors of the formula share.

    The cache identifies a letter by a bit mask of the formula's patterns that match an event.
    """

    def __init__(self, formula: formulas.Formula) -> None:
        self._elements = tuple(dict.fromkeys(elements(formula)))
        self._by_kind: dict[str, list[tuple[int, formulas.EventPattern]]] = {}
        for bit, element in enumerate(self._elements):
            self._by_kind.setdefault(element.kind, []).append((1 << bit, element))
        self._machine = machine_of(formula)
        self.start, self.accepts = self._machine.start, self._machine.accepts
        self._steps: dict[tuple[Any, int], tuple[Any, bool]] = {}

    @classmethod
    @lru_cache(maxsize=256)
    def of(cls, formula: formulas.Formula) -> _Machine:
        return cls(formula)

    def step(self, state: Any, event: Event, at: int) -> tuple[Any, bool]:  # noqa: ANN401 - as in Machine
        """Return the state after an event at a position of its trace, and whether the formula holds then."""
        mask = 0
        for bit, element in self._by_kind.get(event.kind, ()):
            if is_match(element, event, at):
                mask |= bit
        known = self._steps.get((state, mask))
        if known is not None:
            return known
        letter = frozenset(one for bit, one in enumerate(self._elements) if mask >> bit & 1)
        after = self._machine.step(state, letter)
        found = after, self._machine.accepts(after)
        if len(self._steps) < MAX_CACHED_STEPS:
            self._steps[state, mask] = found
        return found
