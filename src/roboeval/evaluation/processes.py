"""The engine that runs and judges programs in several processes of this machine."""

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
from typing import Any, Self

from codebotler.simulator.engine import digest
from codebotler.simulator.pool import map_batches
from codebotler.simulator.worker import EngineError
from roboeval.evaluation.engines import BRIEF, Ran, RunPrograms, Value, Work, own_worker


class Processes:
    """Processes that each have a worker, and replay and judge by themselves what it has run.

    With threads, one core does that for all of them, and more than two wait for it. A process starts when
    there is work for it. Where programs are less isolated, whoever asks for processes warns of it.
    """

    def __init__(self, workers: int, **isolation: bool) -> None:  # as of `WorkerPool`
        self._workers, self._isolation = workers, isolation

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing is left: the processes end with the results."""

    def map_distinct(
        self, function: RunPrograms[Ran], works: Iterable[Work], then: Callable[[Ran], Value]
    ) -> Iterator[Value]:
        """See `Engine`."""
        functions = pickle.dumps((function, then))
        with self._started() as processes:

            def submit(works: Sequence[Work]) -> Future[Sequence[Value]]:
                with starting():
                    return processes.submit(run_batch, functions, self._isolation, works)

            try:
                yield from map_batches(submit, works, workers=self._workers, name=lambda work: digest(*work))
            except BrokenExecutor:
                raise EngineError("a process that judges was lost; perhaps it took too much memory") from None

    @contextmanager
    def _started(self) -> Iterator[ProcessPoolExecutor]:
        context = get_context("spawn")
        with ExitStack() as held:
            with starting():
                line, ours = context.Pipe(duplex=False)
                held.enter_context(line)
                processes = ProcessPoolExecutor(self._workers, context, live_with, (line,))
            held.callback(processes.shutdown, cancel_futures=True)
            held.enter_context(ours)  # closed before the pool shuts down, so that workers exit with us
            yield processes


@contextmanager
def starting() -> Iterator[None]:
    """Start processes that do not hear Ctrl-C, or raise EngineError."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which they inherit
    try:
        yield
    except OSError as error:
        raise EngineError(f"no process that judges can be started: {error.strerror}") from None
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def live_with(line: Connection) -> None:
    """Let this process end as soon as the other end of a line is closed."""
    gc.set_threshold(BRIEF, *gc.get_threshold()[1:])

    def end() -> None:
        line.poll(None)
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def run_batch(functions: bytes, isolation: Mapping[str, bool], works: Sequence[Work]) -> list[Any]:
    """The results for programs, on the worker of this process."""
    function, then = loaded(functions)
    return [then(ran) for ran in function(own_worker(**isolation), works)]


@lru_cache(maxsize=1)
def loaded(functions: bytes) -> tuple[RunPrograms[Any], Callable[[Any], Any]]:
    """The functions that this side has pickled: they hold a whole suite, which is loaded once."""
    return pickle.loads(functions)  # type: ignore[no-any-return] # noqa: S301 - see above
