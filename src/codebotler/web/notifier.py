"""Tells any number of viewers that something has changed; none of them can hold anything up."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


class Notifier:
    """Counts changes and wakes whoever waits for one. Viewers then read what there is; nothing queues up."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._wakes: list[Callable[[], None]] = []
        self.version = 0

    def change(self) -> None:
        """Something has changed; from any thread, and back at once."""
        with self._lock:
            self.version += 1
            wakes = tuple(self._wakes)
        for wake in wakes:
            wake()

    @contextmanager
    def watched(self, wake: Callable[[], None]) -> Iterator[None]:
        """Have something called at each change, from the thread that makes it; it must be back at once."""
        with self._lock:
            self._wakes.append(wake)
        try:
            yield
        finally:
            with self._lock:
                self._wakes.remove(wake)

    async def until(self, holds: Callable[[], bool], seconds: float | None = None) -> bool:
        """Wait on an event loop until something holds.

        Args:
            holds: looked at after each change; back at once.
            seconds: how long to wait at most.

        Returns:
            whether it holds.
        """
        loop, changed = asyncio.get_running_loop(), asyncio.Event()

        def wake() -> None:
            with suppress(RuntimeError):  # the loop has ended, and with it whoever waited
                loop.call_soon_threadsafe(changed.set)

        with self.watched(wake), suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not holds():
                    await changed.wait()
                    changed.clear()
        return holds()
