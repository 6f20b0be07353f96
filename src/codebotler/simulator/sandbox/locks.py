"""Simulates locks: no other thread can release a lock, so waiting for one only passes simulated time."""

from __future__ import annotations

import _thread

from codebotler.simulator.sandbox.execution import ProgramRun


class Lock:
    """Replaces `_thread.lock`. There is no other thread that could release a held lock."""

    run: ProgramRun

    def __init__(self) -> None:
        self._times = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:  # noqa: FBT001, FBT002 - as in _thread
        """Take the lock if it is free. Otherwise, let the timeout pass, or end the run if there is none."""
        if not blocking and timeout != -1:
            raise ValueError("can't specify a timeout for a non-blocking call")
        if self._is_free():
            self._times += 1
            return True
        if blocking and timeout < 0:
            self.run.wait_for_ever()
        if blocking:
            self.run.sleep(timeout)
        return False

    def release(self) -> None:
        """Release the lock."""
        if not self._times:
            raise RuntimeError("release unlocked lock")
        self._times -= 1

    def locked(self) -> bool:
        """Return whether the lock is held."""
        return self._times > 0

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def _is_free(self) -> bool:
        return not self._times

    def _at_fork_reinit(self) -> None:
        self._times = 0


class RLock(Lock):
    """Replaces `_thread.RLock`, with the methods that `threading.Condition` needs."""

    def release(self) -> None:
        """Undo one `acquire`."""
        if not self._times:
            raise RuntimeError("cannot release un-acquired lock")
        self._times -= 1

    def _is_free(self) -> bool:
        return True

    def _is_owned(self) -> bool:
        return self._times > 0

    def _recursion_count(self) -> int:
        return self._times

    def _release_save(self) -> int:
        times, self._times = self._times, 0
        return times

    def _acquire_restore(self, times: int) -> None:
        self._times = times


def simulate_locks(run: ProgramRun) -> None:
    """Replace all locks created from now on. Call this before `threading` is imported."""
    Lock.run = run
    for each in (Lock, RLock):
        each.__module__ = "_thread"
    vars(_thread).update(allocate_lock=Lock, allocate=Lock, lock=Lock, LockType=Lock, RLock=RLock)
