"""Simulates dates: replaces the `datetime` classes that tell the time with versions that ask `time`."""

from __future__ import annotations

import datetime as real  # noqa: ICN001 - the replacements have its usual names
import time


class StandIn(type):
    """Metaclass of the simulated `date` and `datetime`: `isinstance` accepts real dates as well."""

    def __instancecheck__(cls, thing: object) -> bool:
        if cls in (date, datetime):
            return isinstance(thing, cls.__bases__[0])
        return super().__instancecheck__(thing)

    def __subclasscheck__(cls, other: type) -> bool:
        if cls in (date, datetime):
            return issubclass(other, cls.__bases__[0])
        return super().__subclasscheck__(other)


class date(real.date, metaclass=StandIn):  # noqa: N801 - the name of the original
    """Replaces `datetime.date`. Its `today` uses the simulated clock."""

    @classmethod
    def today(cls) -> date:
        """Return the date on the simulated clock."""
        return cls.fromtimestamp(time.time())

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}"


class datetime(real.datetime, metaclass=StandIn):  # noqa: N801 - the name of the original
    """Replaces `datetime.datetime`. Its `now` and `today` use the simulated clock."""

    @classmethod
    def now(cls, tz: real.tzinfo | None = None) -> datetime:
        """Return the time on the simulated clock, by default without a time zone."""
        return cls.fromtimestamp(time.time(), tz)

    @classmethod
    def today(cls) -> datetime:
        """Return the time on the simulated clock, without a time zone."""
        return cls.fromtimestamp(time.time())

    utcnow = today

    def date(self) -> real.date:
        """Return the date without the time of day."""
        return date(self.year, self.month, self.day)

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}"


def simulate_dates() -> None:
    """Replace `datetime.date` and `datetime.datetime` with versions that use the simulated clock."""
    for fake in (date, datetime):
        fake.__module__, fake.__qualname__ = "datetime", fake.__name__
        setattr(real, fake.__name__, fake)
