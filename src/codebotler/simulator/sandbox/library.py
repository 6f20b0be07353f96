"""The standard library as programs see it: all there before the walls close, and none of it tells real time.

Nothing can be imported behind the walls, so that what is listed here is what a program can import, the same
under every version of Python. What tells the time, draws lots or waits is replaced before the modules that
take it for their own are imported.
"""

from __future__ import annotations

import _random
import _thread
import importlib
import os
import posix
import sys
import time

from codebotler.simulator.sandbox.execution import Run
from codebotler.simulator.sandbox.locks import simulate_locks

TYPE_CHECKING = False
if TYPE_CHECKING:
    import datetime as real  # noqa: ICN001 - the stand-ins bear its usual name
    from typing import Any, Self

LISTED = """
    abc argparse array ast asyncio atexit base64 binascii bisect bz2 calendar cmath codecs collections
    collections.abc colorsys concurrent.futures contextlib contextvars copy copyreg csv ctypes dataclasses
    datetime decimal difflib dis enum errno fcntl fnmatch fractions functools gc gettext glob graphlib grp
    hashlib heapq hmac html inspect io ipaddress itertools json keyword linecache locale logging lzma marshal
    math numbers operator os os.path pathlib pickle platform posix pprint pwd queue random re reprlib resource
    sched secrets select selectors shlex shutil signal site socket ssl stat statistics string stringprep
    struct subprocess sys sysconfig tempfile textwrap threading time timeit token tokenize tomllib traceback
    types typing unicodedata unittest unittest.mock urllib.parse uuid warnings weakref zipimport zlib zoneinfo
""".split()  # noqa: SIM905 - a list of a hundred quoted words is no easier to read

CODECS = """
    ascii base64_codec charmap cp1252 hex_codec idna latin_1 punycode raw_unicode_escape rot_13 unicode_escape
    utf_16 utf_16_be utf_16_le utf_32 utf_7 utf_8 utf_8_sig
""".split()  # noqa: SIM905 - the same

SOME_VERSIONS_HAVE = ("typing.io", "typing.re")


def load_library(run: Run) -> None:
    """Import all that a program may import, on the run's clock and with chance that repeats."""
    simulate_chance()
    simulate_locks(run)
    vars(_thread)["get_native_id"] = lambda: 1
    sys.modules["_queue"] = None  # type: ignore[assignment]  # `queue` then takes its own, with simulated locks
    for name in [*LISTED, "_strptime", *(f"encodings.{codec}" for codec in CODECS)]:
        importlib.import_module(name)
    for name in (*SOME_VERSIONS_HAVE, "_queue"):
        sys.modules.pop(name, None)
    simulate_dates()
    simulate_identities()
    simulate_select(run)


def simulate_chance() -> None:
    """Let chance repeat, also where a program asks for an unpredictable seed."""

    class Random(_random.Random):
        def __new__(cls, *_: object, **__: object) -> Self:
            return super().__new__(cls, 0)  # type: ignore[call-arg]  # a seed

        def __init__(self, *_: object, **__: object) -> None:
            self.seed()

        def seed(self, a: Any = None, /) -> None:  # noqa: ANN401 - as in _random
            super().seed(0 if a is None else a)

    _random.Random = Random  # type: ignore[misc]  # `random` takes this one
    source = Random()

    def urandom(size: int, /) -> bytes:
        return source.getrandbits(8 * size).to_bytes(size, "big") if size else b""

    os.urandom = posix.urandom = urandom


def simulate_dates() -> None:
    """Let `datetime` read the time from `time`."""
    import datetime as real  # noqa: PLC0415, ICN001 - see the module's first lines

    class Stand(type):
        """The class of a class that takes the place of another: what is one of those is one of these."""

        def __instancecheck__(cls, thing: object) -> bool:
            return isinstance(thing, cls.__bases__[0])

        def __subclasscheck__(cls, other: type) -> bool:
            return issubclass(other, cls.__bases__[0])

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


def simulate_identities() -> None:
    """Let `uuid` take its time from `time`, and no address of this machine."""
    import uuid  # noqa: PLC0415 - see the module's first lines

    vars(uuid).update(_generate_time_safe=None, _node=1)


def simulate_select(run: Run) -> None:
    """Let a wait for no file be a sleep; a wait for one is forbidden."""
    import select  # noqa: PLC0415 - see the module's first lines

    def simulated(
        read: list[object], write: list[object], other: list[object], timeout: float | None = None, /
    ) -> tuple[list[object], list[object], list[object]]:
        if read or write or other:
            raise PermissionError(1, "Operation not permitted")
        if timeout is None:
            run.wait_for_ever()
        run.sleep(timeout)
        return [], [], []

    select.select = simulated  # type: ignore[assignment]  # it need not know any more
