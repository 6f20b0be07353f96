"""WorkerPool that stay: for who has programs run now and then, from many threads, until the process ends."""

from __future__ import annotations

import atexit
import os
import threading

from codebotler.simulator.engine import WorkerPool


def warm() -> WorkerPool:
    """The pool of this process, started when they are first asked for; one for each core it may use.

    They are ended with the process. A forked process gets others.

    Raises:
        EngineError: no isolated process can be started.
    """
    return STAYING.pool()


class Staying:
    """The pool of this process, if there are any yet."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._pool: WorkerPool | None = None
        self._inherited: list[WorkerPool] = []  # never taken apart: their threads are not here

    def pool(self) -> WorkerPool:
        """Those that there are, or else new ones."""
        with self._lock:
            if self._pool is None:
                self._pool = WorkerPool(cores())
            return self._pool

    def end(self) -> None:
        """End them."""
        with self._lock:
            if self._pool is not None:
                self._pool.__exit__()
                self._pool = None

    def before_fork(self) -> None:
        """Let nobody start them in the meantime."""
        self._lock.acquire()

    def after_fork(self) -> None:
        """Go on, in the process that has forked."""
        self._lock.release()

    def begin_anew(self) -> None:
        """Let go of them, in the process that was forked."""
        if self._pool is not None:
            self._pool.forget()
            self._inherited.append(self._pool)
            self._pool = None
        self._lock.release()


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


STAYING = Staying()
atexit.register(STAYING.end)
os.register_at_fork(
    before=STAYING.before_fork, after_in_parent=STAYING.after_fork, after_in_child=STAYING.begin_anew
)
