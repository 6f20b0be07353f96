"""A cache of judgements on runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

from codebotler.core.trace import Outcome

CachedResult = TypeVar("CachedResult")


MAX_RESULTS, MAX_RESULT_EVENTS = 2_048, 128  # results, and events of all runs of one


class ResultCache(Generic[CachedResult]):
    """Cache of results for runs: many programs do the same in a world, and in similar worlds."""

    def __init__(self) -> None:
        # Keys hold ids, so an entry keeps these objects alive: no other object may get their ids.
        self._known: dict[tuple[object, ...], tuple[CachedResult, object]] = {}

    def of(
        self,
        key: tuple[object, ...],
        keep_alive: object,
        runs: Iterable[Outcome],
        compute: Callable[[], CachedResult],
    ) -> CachedResult:
        """Return the result for runs, computed if the key is new; the entry keeps an object alive."""
        known = self._known.get(key)  # another thread may clear it at any moment
        if known is not None:
            return known[0]
        value = compute()
        if len(self._known) >= MAX_RESULTS:
            self._known.clear()
        if sum(len(outcome.trace) for outcome in runs) <= MAX_RESULT_EVENTS:
            self._known[key] = value, keep_alive
        return value
