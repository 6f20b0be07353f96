"""Simulated dates: stand-ins for the classes of `datetime` that read the time from `time`."""

from __future__ import annotations

import datetime as real  # noqa: ICN001 - the stand-ins bear its usual name
import time


class StandIn(type):
    """Metaclass of a stand-in, which accepts the instances and subclasses of the class that it replaces."""

    def __instancecheck__(cls, thing: object) -> bool:
        if cls in (date, datetime):
            return isinstance(thing, cls.__bases__[0])
        return super().__instancecheck__(thing)

    def __subclasscheck__(cls, other: type) -> bool:
        if cls in (date, datetime):
            return issubclass(other, cls.__bases__[0])
        return super().__subclasscheck__(other)


class date(real.date, metaclass=StandIn):  # noqa: N801 - it takes the place of the real one
    """Takes the place of `datetime.date`."""

    @classmethod
    def today(cls) -> date:
        """The day on the simulated clock."""
        return cls.fromtimestamp(time.time())

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}"


class datetime(real.datetime, metaclass=StandIn):  # noqa: N801 - the same
    """Takes the place of `datetime.datetime`."""

    @classmethod
    def now(cls, tz: real.tzinfo | None = None) -> datetime:
        """The moment on the simulated clock, which has no zone of its own."""
        return cls.fromtimestamp(time.time(), tz)

    @classmethod
    def utcnow(cls) -> datetime:
        """The same."""
        return cls.fromtimestamp(time.time())

    @classmethod
    def today(cls) -> datetime:
        """The same."""
        return cls.fromtimestamp(time.time())

    def date(self) -> real.date:
        """The day alone."""
        return date(self.year, self.month, self.day)

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}"


def simulate_dates() -> None:
    """Put the stand-ins into `datetime`."""
    for fake in (date, datetime):
        fake.__module__, fake.__qualname__ = "datetime", fake.__name__
        setattr(real, fake.__name__, fake)
