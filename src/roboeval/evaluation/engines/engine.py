"""Defines what an engine does, and the engine that runs programs on this machine."""

from __future__ import annotations

import gc
import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from functools import cache
from typing import Protocol, Self, TypeAlias, TypeVar

from codebotler.simulator.engine import digest
from codebotler.simulator.pool import NO_SECCOMP, WorkerPool
from codebotler.simulator.worker import EngineError, Worker

PYTHON_VERSION = ".".join(platform.python_version_tuple()[:2])  # verdicts depend on the version
Work: TypeAlias = tuple[str, ...]  # the name of a task, a program, and where an agent acted if it is one's
RawResult = TypeVar("RawResult")
WorkResult = TypeVar("WorkResult")
RunPrograms: TypeAlias = Callable[[Worker, Sequence[Work]], Sequence[RawResult]]
"""A function that runs a batch of programs on a worker and returns a result for each."""


class Engine(Protocol):
    """Runs programs in isolated processes, on this machine or on others."""

    def map_distinct(
        self, function: RunPrograms[RawResult], works: Iterable[Work], then: Callable[[RawResult], WorkResult]
    ) -> Iterator[WorkResult]:
        """Run `function` on batches of distinct works, and yield `then(result)` for every work, in order.

        A work is a task name and a program. `function` and `then` may run in other processes, so they and
        their results must be picklable.
        """


OpenEngine = AbstractContextManager[Engine]


GC_THRESHOLD = 100_000  # allocations between garbage collections; high because most objects are short-lived


class Local:
    """Runs programs on this machine, in a given pool or in a new pool with the given number of workers."""

    def __init__(self, pool: WorkerPool | int, **isolation: bool) -> None:
        self._given, self._isolation = pool, isolation

    def __enter__(self) -> Self:
        if isinstance(self._given, WorkerPool):
            self._pool = self._given
        else:
            self._pool = WorkerPool(self._given, **self._isolation).__enter__()
        self._threshold = gc.get_threshold()
        gc.set_threshold(GC_THRESHOLD, *self._threshold[1:])
        return self

    def __exit__(self, *_: object) -> None:
        gc.set_threshold(*self._threshold)
        if self._pool is not self._given:
            self._pool.__exit__()

    def map_distinct(
        self, function: RunPrograms[RawResult], works: Iterable[Work], then: Callable[[RawResult], WorkResult]
    ) -> Iterator[WorkResult]:
        """Run each distinct program once, and yield `then(result)` for every work, as in `Engine`."""
        here = self._pool.here
        return self._pool.map_distinct(
            lambda some: function(here(), some), works, name=lambda work: digest(*work), then=then
        )


@cache
def own_worker(*, require_isolation: bool = False, one_process_per_run: bool = False) -> Worker:
    """Return this process's worker, started on first use. Raise EngineError if required isolation fails."""
    worker = Worker(one_process_per_run=one_process_per_run)
    if require_isolation and not worker.has_seccomp:
        worker.close()
        raise EngineError(NO_SECCOMP)
    return worker
