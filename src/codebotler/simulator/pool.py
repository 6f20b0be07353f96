"""A pool of worker threads, and the pool that the whole process shares."""

from __future__ import annotations

import atexit
import contextlib
import logging
import os
import pickle
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, Generic, ParamSpec, Self, TypeVar

from codebotler.simulator.worker import EngineError, Worker

_log = logging.getLogger("codebotler.engine")
NO_SECCOMP = "programs are less isolated here: the kernel does not allow system call filters (seccomp)"

RESULTS_IN_MEMORY = 8_000_000  # bytes of results, before they move to a file
UNREADABLE_KEY = b""  # the name for a key that raised an error
MIN_BATCH_KEYS, MAX_BATCH_KEYS = 16, 64  # keys per call; the first and last calls get fewer
SIGNAL_POLL_SECONDS = 0.5  # with polars loaded, a signal does not interrupt a wait
CALLS_PER_THREAD = 2  # submitted calls per thread, so that no thread idles
MAX_KEYS_AHEAD = 4_000  # keys read before their results are used, since one thread may be slow for seconds

_Key = TypeVar("_Key")
_Called = TypeVar("_Called")
_Value = TypeVar("_Value")
_Arguments = ParamSpec("_Arguments")


class WorkerPool:
    """Runs functions in threads, each of which has a `Worker` to run programs.

    The first worker starts in the background. As a context manager, the pool waits for it on entry. With
    `contextlib.closing`, only the first call waits. Without seccomp, the pool warns, or raises EngineError if
    `require_isolation` is true. `Worker` explains `one_process_per_run`.
    """

    def __init__(
        self, workers: int, *, require_isolation: bool = False, one_process_per_run: bool = False
    ) -> None:
        self.workers = workers
        self._local = threading.local()
        self._threads = ThreadPoolExecutor(
            workers, thread_name_prefix="worker", initializer=lambda: setattr(self._local, "is_ours", True)
        )
        self._new_worker = partial(Worker, one_process_per_run=one_process_per_run)
        self._workers: list[Worker] = []
        self._idle: list[Worker] = []
        self._stopping = False
        # Start it in a pool thread, since processes end with the thread that started them.
        self._first = self._threads.submit(self._start_first, require_isolation=require_isolation)

    def _start_first(self, *, require_isolation: bool) -> None:
        first = self._new_worker()
        if not first.has_seccomp:
            if require_isolation:
                first.close()
                raise EngineError(NO_SECCOMP)
            _log.warning(NO_SECCOMP)
        self._workers.append(first)
        self._idle.append(first)

    def __enter__(self) -> Self:
        """Wait for the first worker. Raise EngineError if it cannot start."""
        try:
            self._first.result()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop all runs, and end all workers and threads."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._stopping = True
        for worker in self._workers:
            worker.stop()
        self._threads.shutdown(wait=True)
        for worker in self._workers:
            worker.close()

    def here(self) -> Worker:
        """Return the calling thread's worker, started on first use."""
        worker: Worker | None = getattr(self._local, "worker", None)
        if worker is None:
            self._first.result()
            try:
                worker = self._idle.pop()
            except IndexError:
                worker = self._new_worker()
                self._workers.append(worker)
                if self._stopping:
                    worker.stop()
            self._local.worker = worker
        return worker

    def submit(
        self, function: Callable[_Arguments, _Value], *args: _Arguments.args, **kwargs: _Arguments.kwargs
    ) -> Future[_Value]:
        """Call a function in a pool thread, where `here` returns a worker. Return a Future of the result."""
        return self._threads.submit(function, *args, **kwargs)

    @property
    def is_here(self) -> bool:
        """Whether the calling thread belongs to this pool. If so, waiting for the pool could deadlock."""
        return getattr(self._local, "is_ours", False)

    def call(self, function: Callable[[], _Value]) -> _Value:
        """Call a function in a pool thread, which may be the current one, and return its result."""
        return function() if self.is_here else self.submit(function).result()

    def map_distinct(
        self,
        function: Callable[[Sequence[_Key]], Sequence[_Called]],
        keys: Iterable[_Key],
        *,
        name: Callable[[_Key], bytes],
        then: Callable[[_Called], Any] = lambda result: result,
    ) -> Iterator[Any]:
        """Yield a function's result for each key, computed in pool threads. `map_batches` has details."""
        return map_batches(
            lambda some: self.submit(function, some), keys, workers=self.workers, name=name, then=then
        )


def map_batches(
    submit: Callable[[Sequence[_Key]], Future[Sequence[_Called]]],
    keys: Iterable[_Key],
    *,
    workers: int,
    name: Callable[[_Key], bytes],
    then: Callable[[_Called], Any] = lambda result: result,
) -> Iterator[Any]:
    """Call a function on batches of keys concurrently, and yield the results in the order of the keys.

    Duplicate keys share one result. While one result is slow, more keys are read, so that the other workers
    stay busy. An error from the keys or from a call is raised when its result is due.

    Args:
        submit: starts a call that takes a few keys and returns one result per key.
        keys: the keys, of which a few are read in advance.
        workers: the number of calls that run at the same time.
        name: returns a short, unique name for a key.
        then: converts each result in the caller's thread, to a value that can be pickled.
    """
    distinct = DistinctKeys(keys, name)
    waiting, failed = distinct.waiting, distinct.failed
    running: dict[Future[Sequence[_Called]], list[bytes]] = {}
    ended: SimpleQueue[Future[Sequence[_Called]]] = SimpleQueue()
    calls = CALLS_PER_THREAD * workers
    with ResultFile() as done, contextlib.ExitStack() as at_end:
        at_end.callback(lambda: [future.cancel() for future in running])  # after an interrupt or an error
        while True:
            while len(running) < calls and (batch := distinct.batch(workers)):
                try:
                    future = submit(list(batch.values()))
                except Exception as error:  # noqa: BLE001 - raised later, after the earlier results
                    failed.update(dict.fromkeys(batch, error))
                    continue
                running[future] = list(batch)
                future.add_done_callback(ended.put)
            if not waiting:
                return
            if ended.empty() and (waiting[0] in done or waiting[0] in failed):
                named = waiting.popleft()
                if named in failed:
                    raise failed[named]
                yield done[named]
                continue
            future = _next(ended)
            names = running.pop(future)
            try:
                results = future.result()
            except Exception as error:  # noqa: BLE001 - raised in place of the result
                failed.update(dict.fromkeys(names, error))
                continue
            for named, result in zip(names, results, strict=True):
                try:
                    done[named] = then(result)
                except Exception as error:  # noqa: BLE001 - raised in place of this result
                    failed[named] = error


def _next(queue: SimpleQueue[_Value]) -> _Value:
    while True:
        with contextlib.suppress(Empty):
            return queue.get(timeout=SIGNAL_POLL_SECONDS)


class DistinctKeys(Generic[_Key]):
    """Reads keys in advance, and returns them in batches. Skips keys whose name has occurred before."""

    def __init__(self, keys: Iterable[_Key], name: Callable[[_Key], bytes]) -> None:
        self._keys, self._name = iter(keys), name
        self._seen: set[bytes] = set()
        self._new: dict[bytes, _Key] = {}  # keys not yet in a batch
        self._sent = 0
        self.waiting: deque[bytes] = deque()  # names of keys whose results are not yet used
        self.failed: dict[bytes, BaseException] = {}

    def batch(self, width: int) -> dict[bytes, _Key]:
        """Return the next keys by name, for one of `width` concurrent calls.

        The batch is empty at the end, or while too many keys wait for results. Batches start small so that
        the first results come soon, and end small so that all calls end together. An error while reading the
        keys counts as the result of the next key.
        """
        size = min(MAX_BATCH_KEYS, max(MIN_BATCH_KEYS, self._sent // 2))
        self._read(size * width)
        share = -(-len(self._new) // width)
        size = min(size, max(share, MIN_BATCH_KEYS if self._sent >= MAX_BATCH_KEYS else 1))
        batch = dict(islice(self._new.items(), size))
        for named in batch:
            del self._new[named]
        self._sent += len(batch)
        return batch

    def _read(self, most: int) -> None:
        try:
            while len(self._new) < most and len(self.waiting) < MAX_KEYS_AHEAD:
                key = next(self._keys)
                name = self._name(key)
                self.waiting.append(name)
                if name not in self._seen:
                    self._seen.add(name)
                    self._new[name] = key
        except StopIteration:
            pass
        except Exception as error:  # noqa: BLE001 - raised later, after the earlier results
            self._keys = iter(())
            self.waiting.append(UNREADABLE_KEY)
            self.failed[UNREADABLE_KEY] = error


class ResultFile:
    """Stores results by name in a temporary file, since there may be a million of them."""

    def __init__(self) -> None:
        self._file = tempfile.SpooledTemporaryFile(RESULTS_IN_MEMORY)  # noqa: SIM115 - closed by __exit__
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

    def __getitem__(self, name: bytes) -> Any:  # noqa: ANN401 - any stored value
        self._file.seek(self._places[name])
        return pickle.load(self._file)  # noqa: S301 - we wrote it


# --- the pool of this process


def shared_pool() -> WorkerPool:
    """Return this process's pool, started on first use with a worker per core, but at least two."""
    with SHARED_POOL.lock:
        if SHARED_POOL.pool is None:
            # With two workers, the check of an agent's program does not hold up the check of a person's.
            workers = max(2, cores())
            SHARED_POOL.pool = WorkerPool(workers).__enter__()  # raises EngineError if it cannot start
        return SHARED_POOL.pool


class SharedPool:
    """Holds this process's pool once it has started. After a fork, the child starts a new one."""

    def __init__(self) -> None:
        self.lock = threading.Lock()  # held during a fork, so that no child inherits half a pool
        self.pool: WorkerPool | None = None
        atexit.register(self.end)
        os.register_at_fork(
            before=self.lock.acquire, after_in_parent=self.lock.release, after_in_child=self.begin_anew
        )

    def end(self) -> None:
        """Close the pool if it has started."""
        with self.lock:
            if self.pool is not None:
                self.pool.close()
                self.pool = None

    def begin_anew(self) -> None:
        """In a forked child, forget the parent's pool, whose threads do not exist in the child."""
        self.pool = None
        self.lock.release()


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


SHARED_POOL = SharedPool()
