"""Run programs in worlds: each pair in a child process of its own, equal pairs once, outcomes in order."""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, ParamSpec, Self, TypeVar, overload

from codebotler.core.arguments import expect_whole
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.trace import Outcome
from codebotler.core.world import World
from codebotler.simulator.distinct import Distinct
from codebotler.simulator.robot import Behaviour, SimulatedRobot
from codebotler.simulator.rules import PAPER, Rules
from codebotler.simulator.worker import EngineError, Worker

__all__ = ["EngineError", "WorkerPool", "digest", "run"]

LOG = logging.getLogger("codebotler.engine")
NO_SECCOMP = "programs are less isolated here: the kernel refuses a list of allowed system calls (seccomp)"
NOT_LINUX = "programs are less isolated here: only Linux has a list of allowed system calls (seccomp)"
ON_WINDOWS = "programs are run on Linux and macOS only; on Windows, use this inside WSL"

Key = TypeVar("Key")
Called = TypeVar("Called")
Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")


def run(
    pairs: Iterable[tuple[str, World]],
    *,
    workers: int | None = None,
    rules: Rules = PAPER,
    skills: SkillTable = SKILLS,
    behaviours: dict[str, Behaviour] | None = None,
    require_isolation: bool = False,
) -> Iterator[Outcome]:
    """Run programs in worlds and yield their outcomes in the order of the pairs.

    Args:
        pairs: source of a program and the world to run it in; read as they are needed.
        workers: how many runs go on at the same time; as many as there are processors by default.
        rules: how the worlds are simulated.
        skills: the skills that programs can call.
        behaviours: what each skill does; those of the eight skills by default.
        require_isolation: whether to refuse where a wall around programs is missing, rather than warn.

    Raises:
        UserError: there are no workers.
        EngineError: no isolated process could be started.
    """
    workers = (os.cpu_count() or 1) if workers is None else workers
    with WorkerPool(workers, require_isolation=require_isolation) as pool:

        def run_pair(pair: tuple[str, World]) -> Outcome:
            source, world = pair
            return pool.here().run(source, lambda: SimulatedRobot(world, rules, skills, behaviours))

        worlds: dict[World, int] = {}

        def name(pair: tuple[str, World]) -> bytes:
            source, world = pair
            return digest(source, str(worlds.setdefault(world, len(worlds))))

        yield from pool.map_distinct(run_pair, pairs, name=name)


def digest(*texts: str) -> bytes:
    """A short name for texts, which no other texts have."""
    hashed = hashlib.sha256()
    for text in texts:
        data = text.encode(errors="surrogatepass")
        hashed.update(len(data).to_bytes(8, "big") + data)
    return hashed.digest()


class WorkerPool:
    """Threads that each own one zygote; use as a context manager.

    Args:
        workers: how many.
        require_isolation: whether to refuse where a wall around programs is missing, rather than warn.

    Raises:
        UserError: there are to be less than 1.
        EngineError: no zygote can be started, or a wall is missing that is required.
    """

    def __init__(self, workers: int, *, require_isolation: bool = False) -> None:
        expect_whole(workers, "the number of workers", least=1)
        if sys.platform == "win32":
            raise EngineError(ON_WINDOWS)
        self.workers = workers
        self._threads = ThreadPoolExecutor(workers, thread_name_prefix="worker")
        self._local = threading.local()
        first = Worker()
        if not first.has_seccomp:
            missing = NO_SECCOMP if sys.platform == "linux" else NOT_LINUX
            if require_isolation:
                first.close()
                raise EngineError(missing)
            LOG.warning(missing)
        self._workers = [first]
        self._idle = [first]
        self._stopping = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._stopping = True
        for worker in self._workers:
            worker.stop()
        self._threads.shutdown(wait=True)
        for worker in self._workers:
            worker.close()

    def here(self) -> Worker:
        """The worker of the calling thread."""
        worker: Worker | None = getattr(self._local, "worker", None)
        if worker is None:
            try:
                worker = self._idle.pop()
            except IndexError:
                worker = Worker()
                self._workers.append(worker)
                if self._stopping:
                    worker.stop()
            self._local.worker = worker
            self._keep_together(worker)
        return worker

    def _keep_together(self, worker: Worker) -> None:
        """Keep this thread and the processes of its worker on one core.

        They take turns, and to wake one on another core costs more than a skill call. For that reason, too,
        this thread does not push a child aside each time that it says something.
        """
        if sys.platform != "linux":
            return
        cores = sorted(os.sched_getaffinity(0))
        core = cores[(os.getpid() + self._workers.index(worker)) % len(cores)]
        with contextlib.suppress(OSError):  # only slower without
            os.sched_setaffinity(0, {core})
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
            worker.stay_on(core)

    def submit(
        self, function: Callable[Arguments, Value], *args: Arguments.args, **kwargs: Arguments.kwargs
    ) -> Future[Value]:
        """Call a function in one of the threads, which may ask for its worker there; from any thread."""
        return self._threads.submit(function, *args, **kwargs)

    def forget(self) -> None:
        """Let go of all in a forked process: the pool, and the threads, are those of the process before."""
        for worker in self._workers:
            worker.forget()

    @overload
    def map_distinct(
        self, function: Callable[[Key], Value], keys: Iterable[Key], *, name: Callable[[Key], bytes]
    ) -> Iterator[Value]: ...

    @overload
    def map_distinct(
        self,
        function: Callable[[Key], Called],
        keys: Iterable[Key],
        *,
        name: Callable[[Key], bytes],
        then: Callable[[Called], Value],
    ) -> Iterator[Value]: ...

    def map_distinct(
        self,
        function: Callable[[Key], Any],
        keys: Iterable[Key],
        *,
        name: Callable[[Key], bytes],
        then: Callable[[Any], Any] = lambda result: result,
    ) -> Iterator[Any]:
        """Like `map`, in threads, calling the function once for equal keys and reading ahead a little.

        While the next result is long in coming, more is read, so that the other threads have work.

        Args:
            function: what to do.
            keys: what to do it to.
            name: a short name of a key, which no other key has.
            then: what to make of each result, in the thread that asks for them; what it returns is pickled.
        """
        return Distinct(self._threads, 8 * self.workers, function, name, then).results(keys)
