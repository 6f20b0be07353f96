"""Results of runs that were judged before."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

from codebotler.core.trace import Outcome

CachedResult = TypeVar("CachedResult")


MAX_RESULTS, MAX_RESULT_EVENTS = 2_048, 128  # results, and events of all runs of one


class ResultCache(Generic[CachedResult]):
    """Results for runs: many programs do the same in the same world, and in worlds that are alike."""

    def __init__(self) -> None:
        # An entry keeps the objects alive whose ids are in its key, so that no other object gets these ids.
        self._known: dict[tuple[object, ...], tuple[CachedResult, object]] = {}

    def of(
        self,
        key: tuple[object, ...],
        keep_alive: object,
        runs: Iterable[Outcome],
        found: Callable[[], CachedResult],
    ) -> CachedResult:
        """Return the result for runs, computed if the key is new; the entry keeps an object alive."""
        known = self._known.get(key)  # another thread may clear it at any moment
        if known is not None:
            return known[0]
        value = found()
        if len(self._known) >= MAX_RESULTS:
            self._known.clear()
        if sum(len(outcome.trace) for outcome in runs) <= MAX_RESULT_EVENTS:
            self._known[key] = value, keep_alive
        return value
