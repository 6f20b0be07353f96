"""A pool of workers, in threads of this process; one of them is shared and lasts as long as the process."""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import pickle
import sys
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from queue import SimpleQueue
from typing import Any, ParamSpec, Self, TypeVar

from codebotler.simulator.worker import EngineError, Worker

LOG = logging.getLogger("codebotler.engine")
NO_SECCOMP = "programs are less isolated here: the kernel refuses filters of system calls (seccomp)"
NOT_LINUX = "programs are less isolated here: only Linux has filters of system calls (seccomp)"
ON_WINDOWS = "programs run on Linux and macOS only; on Windows, use WSL"

IN_MEMORY = 8_000_000  # bytes of results
UNREADABLE = b""  # in the place of a key that could not be read
MOST_AHEAD = 4_000  # keys read whose results are not yet asked for; a thread may be held up for seconds

Key = TypeVar("Key")
Called = TypeVar("Called")
Value = TypeVar("Value")
Arguments = ParamSpec("Arguments")


class WorkerPool:
    """Threads that each own one worker; use as a context manager.

    Where the kernel has no seccomp, this warns, or refuses if isolation is required.
    """

    def __init__(self, workers: int, *, require_isolation: bool = False) -> None:
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
        """Call a function in one of the threads, where `here` is its worker; from any thread."""
        return self._threads.submit(function, *args, **kwargs)

    def forget(self) -> None:
        """Close the descriptors in a forked process, to which neither the workers nor the threads belong."""
        for worker in self._workers:
            worker.forget()

    def map_distinct(
        self,
        function: Callable[[Key], Called],
        keys: Iterable[Key],
        *,
        name: Callable[[Key], bytes],
        then: Callable[[Called], Any] = lambda result: result,
    ) -> Iterator[Any]:
        """Like `map`, in threads, calling the function once for equal keys and reading ahead a little.

        While the next result is long in coming, more is read, so that the other threads have work. What the
        keys or a call raise comes in its place among the results. `name` gives each key a short name of its
        own. `then` is called with each result in the thread that asks for them, and its own is pickled.
        """
        failed: dict[bytes, BaseException] = {}
        waiting: deque[bytes] = deque()
        running: dict[Future[Called], bytes] = {}
        ended: SimpleQueue[Future[Called]] = SimpleQueue()
        remaining = _named(keys, name)
        with ResultFile() as done:
            while True:
                room = min(8 * self.workers - len(running), MOST_AHEAD - len(waiting))
                for named, key in islice(remaining, max(0, room)):
                    waiting.append(named)
                    if named == UNREADABLE:
                        failed[named] = key
                    elif named not in done and named not in running.values():
                        future = self._threads.submit(function, key)
                        running[future] = named
                        future.add_done_callback(ended.put)
                if not waiting:
                    return
                if waiting[0] not in running.values() and ended.empty():
                    named = waiting.popleft()
                    if named in failed:
                        raise failed[named]
                    yield done[named]
                    continue
                future = ended.get()
                named = running.pop(future)
                try:
                    done[named] = then(future.result())
                except Exception as error:  # noqa: BLE001 - raised where the result is waited for
                    failed[named] = error


def _named(keys: Iterable[Key], name: Callable[[Key], bytes]) -> Iterator[tuple[bytes, Any]]:
    """Keys by name; last comes what was raised when they were read, if anything was."""
    try:
        for key in keys:
            yield name(key), key
    except Exception as error:  # noqa: BLE001 - raised after the results of what was read before
        yield UNREADABLE, error


class ResultFile:
    """Results by name, in a temporary file, so that a million of them need little memory."""

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(IN_MEMORY)  # noqa: SIM115 - closed by __exit__
        self._places: dict[bytes, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __contains__(self, name: bytes) -> bool:
        return name in self._places

    def __setitem__(self, name: bytes, value: object) -> None:
        data = pickle.dumps(value)
        place = self._file.seek(0, os.SEEK_END)
        self._file.write(data)
        self._places[name] = place

    def __getitem__(self, name: bytes) -> Any:  # noqa: ANN401 - whatever was put there
        self._file.seek(self._places[name])
        return pickle.load(self._file)  # noqa: S301 - we wrote it


# --- the pool of this process


def shared_pool() -> WorkerPool:
    """The pool of this process, with one worker for each core, started on first use; a fork has its own."""
    with SHARED.lock:
        if SHARED.pool is None:
            SHARED.pool = WorkerPool(cores())
        return SHARED.pool


class SharedPool:
    """The pool of this process once it is started, and what forks do with it."""

    def __init__(self) -> None:
        self.lock = threading.Lock()  # held during a fork, so that no pool is half started in the child
        self.pool: WorkerPool | None = None
        self._inherited: list[WorkerPool] = []  # never taken apart: their threads are not here
        atexit.register(self.end)
        os.register_at_fork(
            before=self.lock.acquire, after_in_parent=self.lock.release, after_in_child=self.begin_anew
        )

    def end(self) -> None:
        """End it."""
        with self.lock:
            if self.pool is not None:
                self.pool.__exit__()
                self.pool = None

    def begin_anew(self) -> None:
        """Let go of it, in the process that was forked."""
        if self.pool is not None:
            self.pool.forget()
            self._inherited.append(self.pool)
            self.pool = None
        self.lock.release()


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


SHARED = SharedPool()
