"""Several processes of this machine: an engine that runs and judges programs in them, and other work."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from functools import lru_cache, partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Self, TypeVar

from codebotler.simulator.engine import digest
from codebotler.simulator.pool import map_batches
from codebotler.simulator.worker import EngineError
from roboeval.evaluation.engines import GC_THRESHOLD, RawResult, RunPrograms, Work, WorkResult, own_worker

JobKey = TypeVar("JobKey")


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
        self, function: RunPrograms[RawResult], works: Iterable[Work], then: Callable[[RawResult], WorkResult]
    ) -> Iterator[WorkResult]:
        """See `Engine`."""
        functions = pickle.dumps((function, then))
        batch = partial(run_batch, functions, self._isolation)
        return map_in_processes(batch, works, workers=self._workers, name=lambda work: digest(*work))


def map_in_processes(
    function: Callable[[Sequence[JobKey]], Sequence[WorkResult]],
    keys: Iterable[JobKey],
    *,
    workers: int,
    name: Callable[[JobKey], bytes],
) -> Iterator[WorkResult]:
    """Call a function with a few keys at a time, in processes; yield the values in the order of the keys.

    `name` gives each key a short name of its own; equal keys are called once.
    """
    with process_pool(workers) as processes:

        def submit(keys: Sequence[JobKey]) -> Future[Sequence[WorkResult]]:
            with starting_processes():
                return processes.submit(function, keys)

        try:
            yield from map_batches(submit, keys, workers=workers, name=name)
        except BrokenExecutor:
            raise EngineError("a worker process was lost; perhaps it took too much memory") from None


@contextmanager
def process_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that end with the block, or with this process."""
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
    """Start processes that do not hear Ctrl-C, or raise EngineError."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # which they inherit
    try:
        yield
    except OSError as error:
        raise EngineError(f"no worker process can be started: {error.strerror}") from None
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def exit_with_parent(pipe: Connection) -> None:
    """Let this process end as soon as the other end of a pipe is closed."""
    gc.set_threshold(GC_THRESHOLD, *gc.get_threshold()[1:])

    def end() -> None:
        pipe.poll(None)
        os._exit(1)

    threading.Thread(target=end, daemon=True).start()


def run_batch(functions: bytes, isolation: Mapping[str, bool], works: Sequence[Work]) -> list[Any]:
    """The results for programs, on the worker of this process."""
    function, then = load_functions(functions)
    return [then(ran) for ran in function(own_worker(**isolation), works)]


@lru_cache(maxsize=1)
def load_functions(functions: bytes) -> tuple[RunPrograms[Any], Callable[[Any], Any]]:
    """The functions that this side has pickled: they hold a whole suite, which is loaded once."""
    return pickle.loads(functions)  # type: ignore[no-any-return] # noqa: S301 - see above
