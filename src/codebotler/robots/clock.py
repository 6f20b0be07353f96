"""A robot's clock: in real time, scaled, or advancing only while a program waits."""

from __future__ import annotations

import threading
import time

from codebotler.core.errors import UserError

FASTEST, SLOWEST = 1e6, 1e-6


class Clock:
    """Time that starts at 0, and waits that can be stopped.

    Args:
        speed: its seconds per real second, from 0.000001 to 1,000,000; None if waiting takes no real time,
            and time advances only by waiting.

    Raises:
        UserError: the speed is out of range.
    """

    def __init__(self, speed: float | None = 1.0) -> None:
        if speed is not None and not SLOWEST <= speed <= FASTEST:
            raise UserError(f"the speed is {speed:g}, but must be from {SLOWEST:f} to {FASTEST:,.0f}")
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
        """Wait for at least 0 seconds of this clock; False if it was stopped before or meanwhile."""
        if self.speed is not None:
            self._stopped.wait(min(seconds / self.speed, threading.TIMEOUT_MAX))
        elif not self._stopped.is_set():
            self._waited += seconds
        return not self._stopped.is_set()

    def stop(self) -> None:
        """End all waiting, now and until the next restart; from any thread."""
        self._stopped.set()

    def restart(self) -> None:
        """Start again from 0."""
        self._start, self._waited = time.monotonic(), 0.0
        self._stopped.clear()
