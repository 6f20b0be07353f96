"""A robot's clock: real time, scaled time, or time that only advances by waiting."""

from __future__ import annotations

import threading
import time

from codebotler.core.errors import UserError

MAX_SPEED, MIN_SPEED = 1e6, 1e-6


class Clock:
    """A clock that starts at 0, with interruptible waiting.

    Args:
        speed: clock seconds per real second, from 0.000001 to 1,000,000; None if time only advances by
            waiting, which takes no real time.

    Raises:
        UserError: the speed is out of range.
    """

    def __init__(self, speed: float | None = 1.0) -> None:
        if speed is not None and not MIN_SPEED <= speed <= MAX_SPEED:
            raise UserError(f"the speed is {speed:g}; it must be from {MIN_SPEED:f} to {MAX_SPEED:,.0f}")
        self.speed = speed
        self._start = time.monotonic()
        self._waited = 0.0
        self._stopped = threading.Event()

    @property
    def now(self) -> float:
        """Seconds since the start."""
        if self.speed is None:
            return self._waited
        return (time.monotonic() - self._start) * self.speed

    def wait(self, seconds: float) -> bool:
        """Wait for at least 0 seconds of this clock; return False if the clock was stopped."""
        if self.speed is not None:
            self._stopped.wait(min(seconds / self.speed, threading.TIMEOUT_MAX))
        elif not self._stopped.is_set():
            self._waited += seconds
        return not self._stopped.is_set()

    def stop(self) -> None:
        """End all waiting, now and until the next restart; any thread may call it."""
        self._stopped.set()

    def restart(self) -> None:
        """Start again from 0."""
        self._start, self._waited = time.monotonic(), 0.0
        self._stopped.clear()
