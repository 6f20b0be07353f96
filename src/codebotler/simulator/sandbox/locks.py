"""Simulates locks: no other thread can release a lock, so waiting for one only passes simulated time.

An `RLock` needs no simulation, since the only thread never waits for it.
"""

from __future__ import annotations

import _thread

from codebotler.simulator.sandbox.execution import ProgramRun


class Lock:
    """Replaces `_thread.lock`. There is no other thread that could release a held lock."""

    run: ProgramRun

    def __init__(self) -> None:
        self._is_held = False

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:  # noqa: FBT001, FBT002 - as in _thread
        """Take the lock if it is free. Otherwise, let the timeout pass, or end the run if there is none."""
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
    """Replace all locks created from now on. Call this before `threading` is imported."""
    Lock.run = run
    Lock.__module__ = "_thread"
    vars(_thread).update(allocate_lock=Lock, allocate=Lock, lock=Lock, LockType=Lock)
