"""The engine that runs and judges programs in several processes of this machine."""

from __future__ import annotations

import gc
import logging
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import ExitStack
from functools import lru_cache
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Self

from codebotler.simulator.engine import digest
from codebotler.simulator.pool import NO_SECCOMP, map_batches
from codebotler.simulator.worker import EngineError
from roboeval.evaluation.engines import BRIEF, Ran, RunPrograms, Value, Work, own_worker

LOG = logging.getLogger("roboeval.processes")


class Processes:
    """Processes that each have a worker, and replay and judge by themselves what it has run.

    With threads, one core does that for all of them, and more than two wait for it. A process starts when
    there is work for it.
    """

    def __init__(self, workers: int, **isolation: bool) -> None:  # as of `WorkerPool`
        self._workers, self._isolation = workers, isolation
        self._has_warned = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left: the processes end with the results."""

    def map_distinct(
        self, function: RunPrograms[Ran], works: Iterable[Work], then: Callable[[Ran], Value]
    ) -> Iterator[Value]:
        """See `Engine`."""
        context = get_context("spawn")
        with ExitStack() as held:
            line, ours = context.Pipe(duplex=False)
            held.enter_context(line)
            processes = ProcessPoolExecutor(self._workers, context, live_with, (line,))
            held.callback(processes.shutdown, cancel_futures=True)
            held.enter_context(ours)  # closed before: no process goes on with what nobody waits for
            functions = pickle.dumps((function, then))

            def submit(works: Sequence[Work]) -> Future[Sequence[tuple[Value, bool]]]:
                return processes.submit(run_batch, functions, self._isolation, works)

            try:
                yield from map_batches(
                    submit, works, workers=self._workers, name=lambda work: digest(*work), then=self._value
                )
            except BrokenExecutor:
                raise EngineError("a process that judges was lost; the same command continues") from None

    def _value(self, told: tuple[Value, bool]) -> Value:
        value, has_seccomp = told
        if not has_seccomp and not self._has_warned:
            LOG.warning(NO_SECCOMP)
            self._has_warned = True
        return value


def live_with(line: Connection) -> None:
    """Let this process end as soon as the other end of a line is closed, and leave Ctrl-C to that side."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    gc.set_threshold(BRIEF, *gc.get_threshold()[1:])

    def end() -> None:
        line.poll(None)
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def run_batch(
    functions: bytes, isolation: Mapping[str, bool], works: Sequence[Work]
) -> Sequence[tuple[Any, bool]]:
    """The results for programs, each with whether a filter of system calls was around it."""
    function, then = loaded(functions)
    worker = own_worker(**isolation)
    return [(then(ran), worker.has_seccomp) for ran in function(worker, works)]


@lru_cache(maxsize=1)
def loaded(functions: bytes) -> tuple[RunPrograms[Any], Callable[[Any], Any]]:
    """The functions that this side has pickled: they hold a whole suite, which is loaded once."""
    return pickle.loads(functions)  # type: ignore[no-any-return] # noqa: S301 - see above
