"""Limits the processor time of a block of code."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Iterator
from types import FrameType

CLOCK_CHECKS = 100  # number of clock checks before the limit; each also lets other threads run


class TimeLimitExceeded(Exception):  # noqa: N818 - a signal, not an error
    """Raised inside a `time_limit` block when the processor time is used up."""


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise TimeLimitExceeded after `seconds` of processor time in the block, but only in the main thread."""
    if threading.current_thread() is not threading.main_thread():  # only the main thread receives signals
        yield
        return
    end = time.thread_time() + seconds

    def check_clock(_signal: int, _frame: FrameType | None) -> None:
        if time.thread_time() > end:
            raise TimeLimitExceeded
        time.sleep(0)  # let other threads run, because a regex search does not

    before = signal.signal(signal.SIGVTALRM, check_clock)
    try:
        try:
            signal.setitimer(signal.ITIMER_VIRTUAL, seconds / CLOCK_CHECKS, seconds / CLOCK_CHECKS)
            yield
        finally:
            signal.signal(signal.SIGVTALRM, signal.SIG_IGN)
    finally:  # also if the limit is reached just as the work ends
        signal.signal(signal.SIGVTALRM, signal.SIG_IGN)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
