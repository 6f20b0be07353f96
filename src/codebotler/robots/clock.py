"""A robot's time: as it passes, scaled, or passing only when somebody waits; a stop ends all waiting."""

from __future__ import annotations

import threading
import time

from codebotler.core.errors import UserError

FASTEST, SLOWEST = 1e6, 1e-6
"""Speeds beyond which numbers of seconds stop being exact, and nobody would watch."""


class Clock:
    """Time that starts at 0 and goes on by itself, unless nobody waits for it in truth.

    Args:
        speed: how many of its seconds pass in a real one, from 0.000001 to 1,000,000; None where waiting
            takes no real time, and time passes only by waiting.

    Raises:
        UserError: the speed is out of its range.
    """

    def __init__(self, speed: float | None = 1.0) -> None:
        if speed is not None and not SLOWEST <= speed <= FASTEST:
            raise UserError(f"the speed is {speed:g}, but it must be from {SLOWEST:f} to {FASTEST:,.0f}")
        self.speed = speed
        self._start = time.monotonic()
        self._waited = 0.0
        self._stopped = threading.Event()

    @property
    def now(self) -> float:
        """How late it is, in its seconds since the start."""
        if self.speed is None:
            return self._waited
        return (time.monotonic() - self._start) * self.speed

    def wait(self, seconds: float) -> bool:
        """Wait, and tell whether all of it has passed, and nobody has stopped it.

        Args:
            seconds: its own, at least 0.
        """
        if self.speed is None:
            self._waited += 0.0 if self._stopped.is_set() else seconds
            return not self._stopped.is_set()
        ends = time.monotonic() + seconds / self.speed
        while (left := ends - time.monotonic()) > 0 and not self._stopped.is_set():
            self._stopped.wait(min(left, threading.TIMEOUT_MAX))
        return not self._stopped.is_set()

    def stop(self) -> None:
        """End all waiting, from any thread, now and from now on."""
        self._stopped.set()

    def restart(self) -> None:
        """Let it be 0 again, and let it be waited for."""
        self._start, self._waited = time.monotonic(), 0.0
        self._stopped.clear()
