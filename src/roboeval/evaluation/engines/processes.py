"""Runs and judges programs in several processes on this machine."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import lru_cache
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from codebotler.simulator.engine import digest
from codebotler.simulator.pool import map_batches
from codebotler.simulator.worker import EngineError
from roboeval.evaluation.engines.engine import (
    GC_THRESHOLD,
    RawResult,
    RunPrograms,
    Work,
    WorkResult,
    own_worker,
)


class Processes:
    """Runs programs in several processes. Each process has a worker, and judges what its worker runs.

    Threads instead of processes would share a single core. A process starts when there is work for it, and
    all of them end after the last result. The caller must warn if programs are not fully isolated.
    """

    def __init__(self, workers: int, **isolation: bool) -> None:
        self._workers, self._isolation = workers, isolation

    def map_distinct(
        self, function: RunPrograms[RawResult], works: Iterable[Work], then: Callable[[RawResult], WorkResult]
    ) -> Iterator[WorkResult]:
        """Run each distinct program once, and yield `then(result)` for every work, as in `Engine`."""
        functions = pickle.dumps((function, then))
        with process_pool(self._workers) as processes:

            def submit(some: Sequence[Work]) -> Future[Sequence[WorkResult]]:
                with starting_processes():
                    return processes.submit(run_batch, functions, self._isolation, some)

            try:
                yield from map_batches(submit, works, workers=self._workers, name=lambda work: digest(*work))
            except BrokenExecutor:
                raise EngineError("a worker process died; use fewer workers if memory is short") from None


@contextmanager
def process_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Yield a pool of processes that end with the `with` block, or when this process dies."""
    context = get_context("spawn")
    with ExitStack() as held:
        with starting_processes():
            pipe, ours = context.Pipe(duplex=False)
            held.enter_context(pipe)
            processes = ProcessPoolExecutor(workers, context, exit_with_parent, (pipe,))
        held.callback(processes.shutdown, cancel_futures=True)
        held.enter_context(ours)  # closed before the pool shuts down, so that workers exit with us
        yield processes


@contextmanager
def starting_processes() -> Iterator[None]:
    """Make processes started in the block ignore Ctrl-C. Raise EngineError if they cannot start."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # child processes inherit the mask
    try:
        yield
    except OSError as error:
        raise EngineError(f"cannot start a worker process ({error.strerror}); use fewer workers") from None
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def exit_with_parent(pipe: Connection) -> None:
    """Start a thread that exits this process when its parent closes the other end of `pipe`, or dies."""
    gc.set_threshold(GC_THRESHOLD, *gc.get_threshold()[1:])

    def end() -> None:
        pipe.poll(None)
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def run_batch(functions: bytes, isolation: Mapping[str, bool], works: Sequence[Work]) -> list[Any]:
    """Run programs with this process's worker, by the pickled `function` and `then` of `map_distinct`."""
    function, then = load_functions(functions)
    return [then(ran) for ran in function(own_worker(**isolation), works)]


@lru_cache(maxsize=1)
def load_functions(functions: bytes) -> tuple[RunPrograms[Any], Callable[[Any], Any]]:
    """Unpickle the functions of `map_distinct`, and cache them, because they contain a whole suite."""
    return pickle.loads(functions)  # type: ignore[no-any-return] # noqa: S301 - pickled by our own parent process
