"""Caches results computed from runs, such as judgements."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Generic, TypeVar

from codebotler.core.trace import Outcome

CachedResult = TypeVar("CachedResult")


MAX_RESULTS, MAX_RESULT_EVENTS = 2_048, 128  # limits on entries, and on all events in an entry's runs


class ResultCache(Generic[CachedResult]):
    """Caches results by run, because many programs behave identically in a world or in similar worlds."""

    def __init__(self) -> None:
        # Keys contain object ids, which must not be reused, so entries keep the objects alive.
        self._known: dict[tuple[object, ...], tuple[CachedResult, object]] = {}

    def of(
        self,
        key: tuple[object, ...],
        keep_alive: object,
        runs: Iterable[Outcome],
        compute: Callable[[], CachedResult],
    ) -> CachedResult:
        """Return the cached result for the runs, or compute it. The entry keeps `keep_alive` alive."""
        known = self._known.get(key)  # another thread may clear the cache at any moment
        if known is not None:
            return known[0]
        value = compute()
        if len(self._known) >= MAX_RESULTS:
            self._known.clear()
        if sum(len(outcome.trace) for outcome in runs) <= MAX_RESULT_EVENTS:
            self._known[key] = value, keep_alive
        return value
