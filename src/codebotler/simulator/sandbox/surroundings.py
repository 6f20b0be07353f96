"""What a program sees of the world outside: a simulated clock, fixed chance, no input and no output."""

from __future__ import annotations

import datetime as real  # noqa: ICN001 - the stand-ins bear its usual name
import io
import os
import random
import site
import sys
import time
import timeit
from typing import Any

from codebotler.simulator.sandbox.execution import RECURSION_LIMIT, Run


def simulate_surroundings(run: Run) -> None:
    """Give the program a clock of the engine's, chance that repeats, an empty input, a deaf output."""
    simulate_time(run)
    simulate_dates()
    simulate_chance()
    sys.stdin = io.StringIO("")
    sys.stdout = sys.stderr = io.TextIOWrapper(Nowhere(), encoding="utf-8", errors="replace")
    sys.argv = ["program"]
    os.environ.clear()
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
    """Let `time` and all that reads it follow the engine's clock."""
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
    time.clock_gettime = lambda clock: (start if clock == time.CLOCK_REALTIME else 0.0) + run.now
    time.clock_gettime_ns = lambda clock: int(time.clock_gettime(clock) * 1e9)
    timeit.default_timer = time.perf_counter
    for function in (timeit.timeit, timeit.repeat, timeit.Timer.__init__):
        given = function.__defaults__ or ()
        function.__defaults__ = tuple(time.perf_counter if callable(one) else one for one in given)


class Stand(type):
    """The class of a class that takes the place of another: what is one of those is one of these."""

    def __instancecheck__(cls, thing: object) -> bool:
        return isinstance(thing, cls.__bases__[0])

    def __subclasscheck__(cls, other: type) -> bool:
        return issubclass(other, cls.__bases__[0])


def simulate_dates() -> None:
    """Let `datetime` read the time from `time`."""

    class date(real.date, metaclass=Stand):  # noqa: N801 - it takes the place of the real one
        @classmethod
        def today(cls) -> date:
            return cls.fromtimestamp(time.time())

        def __repr__(self) -> str:
            return f"datetime.{super().__repr__()}"

    class datetime(real.datetime, metaclass=Stand):  # noqa: N801 - the same
        @classmethod
        def now(cls, tz: real.tzinfo | None = None) -> datetime:
            return cls.fromtimestamp(time.time(), tz)

        @classmethod
        def utcnow(cls) -> datetime:
            return cls.fromtimestamp(time.time())

        @classmethod
        def today(cls) -> datetime:
            return cls.fromtimestamp(time.time())

        def __repr__(self) -> str:
            return f"datetime.{super().__repr__()}"

    for fake in (date, datetime):
        fake.__module__, fake.__qualname__ = "datetime", fake.__name__
        setattr(real, fake.__name__, fake)


def simulate_chance() -> None:
    """Let `random` repeat, also where a program asks for an unpredictable seed."""

    class Random(random.Random):
        def seed(self, a: Any = None, version: int = 2) -> None:  # noqa: ANN401 - as in random
            super().seed(0 if a is None else a, version)

    fixed = Random()
    for name in random.__all__:
        if name not in ("Random", "SystemRandom"):
            setattr(random, name, getattr(fixed, name))
    random.Random = Random  # type: ignore[misc]  # programs get the one that repeats
