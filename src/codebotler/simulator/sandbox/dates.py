"""Simulated dates: replacements for the classes of `datetime` that read the time from `time`."""

from __future__ import annotations

import datetime as real  # noqa: ICN001 - the replacements have its usual names
import time


class StandIn(type):
    """Metaclass of a replacement, which accepts instances and subclasses of the original class."""

    def __instancecheck__(cls, thing: object) -> bool:
        if cls in (date, datetime):
            return isinstance(thing, cls.__bases__[0])
        return super().__instancecheck__(thing)

    def __subclasscheck__(cls, other: type) -> bool:
        if cls in (date, datetime):
            return issubclass(other, cls.__bases__[0])
        return super().__subclasscheck__(other)


class date(real.date, metaclass=StandIn):  # noqa: N801 - the name of the original
    """Replaces `datetime.date`."""

    @classmethod
    def today(cls) -> date:
        """The date on the simulated clock."""
        return cls.fromtimestamp(time.time())

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}"


class datetime(real.datetime, metaclass=StandIn):  # noqa: N801 - the name of the original
    """Replaces `datetime.datetime`."""

    @classmethod
    def now(cls, tz: real.tzinfo | None = None) -> datetime:
        """The time on the simulated clock, which has no time zone."""
        return cls.fromtimestamp(time.time(), tz)

    @classmethod
    def today(cls) -> datetime:
        """The time on the simulated clock."""
        return cls.fromtimestamp(time.time())

    utcnow = today

    def date(self) -> real.date:
        """The date without the time."""
        return date(self.year, self.month, self.day)

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}"


def simulate_dates() -> None:
    """Put the replacements into `datetime`."""
    for fake in (date, datetime):
        fake.__module__, fake.__qualname__ = "datetime", fake.__name__
        setattr(real, fake.__name__, fake)
