"""Lanes that stay: for who has programs run now and then, from many threads, until the process ends."""

from __future__ import annotations

import atexit
import os
import threading

from codebotler.simulator.engine import Lanes


def warm() -> Lanes:
    """The lanes of this process, started when they are first asked for; one for each core it may use.

    They are ended with the process. A forked process gets others.

    Raises:
        EngineError: no isolated process can be started.
    """
    return STAYING.lanes()


class Staying:
    """The lanes of this process, if there are any yet."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._lanes: Lanes | None = None
        self._inherited: list[Lanes] = []  # never taken apart: their threads are not here

    def lanes(self) -> Lanes:
        """Those that there are, or else new ones."""
        with self._lock:
            if self._lanes is None:
                self._lanes = Lanes(cores())
            return self._lanes

    def end(self) -> None:
        """End them."""
        with self._lock:
            if self._lanes is not None:
                self._lanes.__exit__()
                self._lanes = None

    def before_fork(self) -> None:
        """Let nobody start them in the meantime."""
        self._lock.acquire()

    def after_fork(self) -> None:
        """Go on, in the process that has forked."""
        self._lock.release()

    def begin_anew(self) -> None:
        """Let go of them, in the process that was forked."""
        if self._lanes is not None:
            self._lanes.forget()
            self._inherited.append(self._lanes)
            self._lanes = None
        self._lock.release()


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


STAYING = Staying()
atexit.register(STAYING.end)
os.register_at_fork(
    before=STAYING.before_fork, after_in_parent=STAYING.after_fork, after_in_child=STAYING.begin_anew
)
