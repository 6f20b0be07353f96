"""A limit on the processor time of a block of code."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Iterator
from types import FrameType

CLOCK_CHECKS = (
    100  # times that the clock is looked at within a limit; then other threads have their turn, too
)


class TimeLimitExceeded(Exception):  # noqa: N818 - no mistake of the caller
    """The limit was reached."""


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Limit the processor time of the block, in seconds of this thread, if it is the main one."""
    if threading.current_thread() is not threading.main_thread():  # which alone can be interrupted
        yield
        return
    end = time.thread_time() + seconds

    def look(_signal: int, _frame: FrameType | None) -> None:
        if time.thread_time() > end:
            raise TimeLimitExceeded
        time.sleep(0)  # a search lets no other thread run

    before = signal.signal(signal.SIGVTALRM, look)
    try:
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, seconds / CLOCK_CHECKS, seconds / CLOCK_CHECKS)
            yield
        finally:
            signal.signal(signal.SIGVTALRM, signal.SIG_IGN)
    finally:  # also where the limit is reached just when the work is done
        signal.signal(signal.SIGVTALRM, signal.SIG_IGN)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
