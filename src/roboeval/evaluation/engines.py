"""Where programs run: on the cores of this machine, or on those of a Ray cluster."""

from __future__ import annotations

import gc
import platform
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from functools import cache
from typing import Protocol, Self, TypeAlias, TypeVar

from codebotler.simulator.engine import digest
from codebotler.simulator.pool import WorkerPool, without_filter
from codebotler.simulator.worker import EngineError, Worker

PYTHON_VERSION = ".".join(platform.python_version_tuple()[:2])  # what verdicts depend on
Work: TypeAlias = tuple[str, str]  # the name of a task, and a program
RawResult = TypeVar("RawResult")
WorkResult = TypeVar("WorkResult")
RunPrograms: TypeAlias = Callable[[Worker, Sequence[Work]], Sequence[RawResult]]
"""Runs a few programs on a worker, and returns a result for each."""


class Engine(Protocol):
    """Calls functions that run programs isolated."""

    def map_distinct(
        self, function: RunPrograms[RawResult], works: Iterable[Work], then: Callable[[RawResult], WorkResult]
    ) -> Iterator[WorkResult]:
        """The values of `then`, in the order of the programs, which are read as needed; equal ones run once.

        `function` and its results can be pickled; `then` runs in the main thread of a process if possible.
        """
        ...


OpenEngine = AbstractContextManager[Engine]


GC_THRESHOLD = (
    100_000  # events and the like that are made before garbage is looked for: nearly all live briefly
)


class Local:
    """The cores of this machine: given pool, or some of its own, which end with the context."""

    def __init__(self, pool: WorkerPool | int, **isolation: bool) -> None:  # as of `WorkerPool`
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
        """See `Engine`."""
        here = self._pool.here
        return self._pool.map_distinct(
            lambda some: function(here(), some), works, name=lambda work: digest(*work), then=then
        )


# --- in other processes


@cache
def own_worker(*, require_isolation: bool = False, one_process_per_run: bool = False) -> Worker:
    """The worker of this process, kept for the next programs."""
    worker = Worker(one_process_per_run=one_process_per_run)
    if require_isolation and not worker.has_seccomp:
        worker.close()
        raise EngineError(without_filter())
    return worker
