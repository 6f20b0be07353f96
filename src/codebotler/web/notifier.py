"""`Notifier`: wakes all viewers of a console after each change."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing, suppress


class Notifier:
    """Wakes all viewers after each change. They then read the latest view, so no queue can build up."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # a signal handler may take it again
        self._wakes: list[Callable[[], None]] = []
        self.is_closed = False

    def change(self) -> None:
        """Wake all viewers, from any thread."""
        with self._lock:
            wakes = tuple(self._wakes)
        for wake in wakes:
            wake()

    def close(self) -> None:
        """End all loops over `changes`, because the server ends."""
        self.is_closed = True
        self.change()

    async def changes(self) -> AsyncGenerator[None]:
        """Yield now and after each change, until `close`. Changes in quick succession may count as one."""
        loop, changed = asyncio.get_running_loop(), asyncio.Event()

        def wake() -> None:
            with suppress(RuntimeError):  # the event loop has ended
                loop.call_soon_threadsafe(changed.set)

        with self._lock:
            self._wakes.append(wake)
        try:
            while not self.is_closed:
                changed.clear()
                yield
                await changed.wait()
        finally:
            with self._lock:
                self._wakes.remove(wake)

    async def until(self, is_met: Callable[[], bool], seconds: float | None = None) -> bool:
        """Wait until a condition is met or, if given, `seconds` have passed. Return whether it is met."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds), aclosing(self.changes()) as changes:
                async for _ in changes:
                    if is_met():
                        return True
        return is_met()
