"""A robot's clock, which follows real time, runs faster or slower, or advances only by waits."""

from __future__ import annotations

import threading
import time

from codebotler.core.errors import UserError

MAX_SPEED, MIN_SPEED = 1e6, 1e-6


class Clock:
    """A clock that starts at 0 and whose waits can be interrupted from another thread.

    Args:
        speed: clock seconds per real second, from 0.000001 to 1,000,000. With None, each wait returns
            immediately and advances the clock, which otherwise stands still.

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
        """The time since the clock was created or last restarted, in clock seconds."""
        if self.speed is None:
            return self._waited
        return (time.monotonic() - self._start) * self.speed

    def wait(self, seconds: float) -> bool:
        """Wait for a number of clock seconds, 0 or more. Return True, or False if the clock was stopped."""
        if self.speed is not None:
            self._stopped.wait(min(seconds / self.speed, threading.TIMEOUT_MAX))
        elif not self._stopped.is_set():
            self._waited += seconds
        return not self._stopped.is_set()

    def stop(self) -> None:
        """Interrupt all waits. Until `restart`, later waits return immediately. Any thread may call this."""
        self._stopped.set()

    def restart(self) -> None:
        """Reset the clock to 0 and let it run again after a stop."""
        self._start, self._waited = time.monotonic(), 0.0
        self._stopped.clear()
