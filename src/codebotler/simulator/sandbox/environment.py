"""Simulates a program's environment: clock, locks, streams and process ids. Forbids tracing hooks."""

from __future__ import annotations

import _thread
import builtins
import io
import os
import posix
import sys
import time
import types
from _sitebuiltins import Quitter

from codebotler.simulator.sandbox.execution import PROGRAM_RECURSION_LIMIT, ProgramRun

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any


def simulate_environment(run: ProgramRun) -> None:
    """Give programs a simulated clock and locks, empty input, discarded output and an empty environment."""
    simulate_time(run)
    simulate_locks(run)
    sys.stdin = io.StringIO("")
    sys.stdout = sys.stderr = io.TextIOWrapper(_Nowhere(), encoding="utf-8", errors="replace")
    sys.argv = ["program"]
    os.environ.clear()
    for module in (os, posix):
        vars(module).update(
            getpid=staticmethod(lambda: 1),
            getppid=staticmethod(lambda: 0),
            cpu_count=staticmethod(lambda: 1),
            sysconf=staticmethod(lambda name, /: -1),  # noqa: ARG005 - as in `os`; -1 means unknown
            sched_getaffinity=staticmethod(lambda process, /: {0}),  # noqa: ARG005 - as in `os`
            times=staticmethod(lambda: os.times_result((run.now, 0.0, 0.0, 0.0, run.now))),
        )
    forbid_watching()
    for name in ("exit", "quit"):
        setattr(builtins, name, Quitter(name, "Ctrl-D (i.e. EOF)"))
    sys.setrecursionlimit(PROGRAM_RECURSION_LIMIT)


def forbid_watching() -> None:
    """Forbid tracing hooks, since a hook would run inside our code when the program ends."""

    def forbidden(*_: object) -> None:
        raise PermissionError(1, "a program cannot trace its own execution")

    vars(sys).update(settrace=forbidden, setprofile=forbidden, addaudithook=forbidden)
    vars(sys).pop("monitoring", None)  # exists since Python 3.12


class _Nowhere(io.BufferedIOBase):
    """An output stream that discards everything."""

    def writable(self) -> bool:
        return True

    def write(self, data: Any, /) -> int:  # noqa: ANN401 - any buffer
        return len(data)


def simulate_time(run: ProgramRun) -> None:
    """Make the module `time` follow the run's clock."""
    for name in ("time", "monotonic", "perf_counter", "process_time", "thread_time"):
        clock = (lambda: run.start + run.now) if name == "time" else (lambda: run.now)
        setattr(time, name, clock)
        setattr(time, name + "_ns", lambda clock=clock: int(clock() * 1e9))
    time.sleep = run.sleep
    localtime, gmtime, strftime, asctime = time.localtime, time.gmtime, time.strftime, time.asctime

    def or_now(given: tuple[Any, ...]) -> tuple[Any, ...]:
        return given if given and given[0] is not None else (time.time(),)

    time.gmtime = lambda *seconds: gmtime(*or_now(seconds))
    time.localtime = lambda *seconds: localtime(*or_now(seconds))
    time.strftime = lambda form, *when: strftime(form, *(when or [time.localtime()]))
    time.asctime = lambda *when: asctime(*(when or [time.localtime()]))
    time.ctime = lambda *seconds: asctime(time.localtime(*seconds))
    time.clock_gettime = lambda clock: time.time() if clock == time.CLOCK_REALTIME else run.now
    time.clock_gettime_ns = lambda clock: int(time.clock_gettime(clock) * 1e9)
    for name, function in vars(time).items():
        if isinstance(function, types.FunctionType):  # a class attribute would make it a method
            function.__name__ = function.__qualname__ = name
            setattr(time, name, staticmethod(function))


# --- locks


class Lock:
    """Replaces `_thread.lock`. No other thread could release it, so a wait only passes simulated time."""

    # An `RLock` needs no replacement, since the only thread never waits for it.
    run: ProgramRun

    def __init__(self) -> None:
        self._is_held = False

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:  # noqa: FBT001, FBT002 - as in _thread
        """Take the lock if it is free, else wait and return False. A wait without `timeout` ends the run."""
        if not blocking and timeout != -1:
            raise ValueError("can't specify a timeout for a non-blocking call")
        if not self._is_held:
            self._is_held = True
            return True
        if blocking and timeout < 0:
            self.run.wait_for_ever()
        if blocking:
            self.run.sleep(timeout)
        return False

    def release(self) -> None:
        """Release the lock."""
        if not self._is_held:
            raise RuntimeError("release unlocked lock")
        self._is_held = False

    def locked(self) -> bool:
        """Return whether the lock is held."""
        return self._is_held

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def _at_fork_reinit(self) -> None:
        self._is_held = False


def simulate_locks(run: ProgramRun) -> None:
    """Make all new locks wait on the clock of `run`. Call this before `threading` is imported."""
    Lock.run = run
    Lock.__module__ = "_thread"
    vars(_thread).update(allocate_lock=Lock, allocate=Lock, lock=Lock, LockType=Lock)
