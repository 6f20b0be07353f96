"""What a program sees of the world outside: a simulated clock, fixed chance, no input and no output."""

from __future__ import annotations

import io
import os
import site
import sys
from typing import Any

from codebotler.simulator.sandbox.execution import Run

# Python 3.11 counts calls into C as well: with three more, a function can call itself as often as under 3.12.
RECURSION_LIMIT = 1000 if sys.version_info >= (3, 12) else 1003


def simulate_surroundings(run: Run) -> None:
    """Give the program a clock of the engine's, chance that repeats, an empty input, a deaf output."""
    simulate_time(run)
    simulate_chance()
    sys.stdin = io.StringIO("")
    sys.stdout = sys.stderr = io.TextIOWrapper(Nowhere(), encoding="utf-8", errors="replace")
    sys.argv = ["program"]
    os.getpid = lambda: 1
    site.setquit()
    sys.setrecursionlimit(RECURSION_LIMIT)


class Nowhere(io.BufferedIOBase):
    """An output that forgets."""

    def writable(self) -> bool:
        """Accept everything."""
        return True

    def write(self, data: Any, /) -> int:  # noqa: ANN401 - any buffer
        """Forget it."""
        return len(data)


def simulate_time(run: Run) -> None:
    """Let `time` and `datetime` read the engine's clock."""
    import datetime as real  # noqa: ICN001, PLC0415 - the module is changed, not used
    import time  # noqa: PLC0415 - the same

    start = run.job["clock"]
    for name in ("time", "monotonic", "perf_counter", "process_time", "thread_time"):
        origin = start if name == "time" else 0.0
        setattr(time, name, lambda origin=origin: origin + run.now)
        setattr(time, name + "_ns", lambda origin=origin: int((origin + run.now) * 1e9))
    time.sleep = run.sleep
    localtime, gmtime, strftime, asctime = time.localtime, time.gmtime, time.strftime, time.asctime

    def or_now(given: tuple[Any, ...]) -> tuple[Any, ...]:
        return given if given and given[0] is not None else (time.time(),)

    time.gmtime = lambda *seconds: gmtime(*or_now(seconds))
    time.localtime = lambda *seconds: localtime(*or_now(seconds))
    time.strftime = lambda form, *when: strftime(form, *(when or [time.localtime()]))
    time.asctime = lambda *when: asctime(*(when or [time.localtime()]))
    time.ctime = lambda *seconds: asctime(time.localtime(*seconds))

    class date(real.date):  # noqa: N801 - it takes the place of the real one
        @classmethod
        def today(cls) -> date:
            return cls.fromtimestamp(time.time())

    class datetime(real.datetime):  # noqa: N801 - the same
        @classmethod
        def now(cls, tz: real.tzinfo | None = None) -> datetime:
            return cls.fromtimestamp(time.time(), tz)

        @classmethod
        def utcnow(cls) -> datetime:
            return cls.fromtimestamp(time.time())

        @classmethod
        def today(cls) -> datetime:
            return cls.fromtimestamp(time.time())

    for fake in (date, datetime):
        fake.__module__, fake.__qualname__ = "datetime", fake.__name__
        setattr(real, fake.__name__, fake)


def simulate_chance() -> None:
    """Let `random` repeat, also where a program asks for an unpredictable seed."""
    import random  # noqa: PLC0415 - the module is changed, not used

    class Random(random.Random):
        def seed(self, a: Any = None, version: int = 2) -> None:  # noqa: ANN401 - as in random
            super().seed(0 if a is None else a, version)

    fixed = Random()
    for name in random.__all__:
        if name not in ("Random", "SystemRandom"):
            setattr(random, name, getattr(fixed, name))
    random.Random = Random  # type: ignore[misc]  # programs get the one that repeats
