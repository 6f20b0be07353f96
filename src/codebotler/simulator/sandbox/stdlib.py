"""Loads the standard library for programs before isolation, with a simulated clock and fixed seeds.

An isolated process cannot import files, so programs can only import the modules listed here, which are the
same for all Python versions. Functions that tell the time, return random values or wait are replaced before
other modules import them.
"""

from __future__ import annotations

import _random
import _thread
import importlib
import os
import posix
import sys

from codebotler.simulator.sandbox.execution import ProgramRun

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any, Self

LISTED = """
    abc argparse array ast asyncio atexit base64 binascii bisect bz2 calendar cmath codecs collections
    collections.abc colorsys concurrent.futures concurrent.futures.thread contextlib contextvars copy copyreg
    csv ctypes dataclasses
    datetime decimal difflib dis enum errno fcntl fnmatch fractions functools gc gettext glob graphlib grp
    hashlib heapq hmac html inspect io ipaddress itertools json keyword linecache locale logging lzma marshal
    math numbers operator os os.path pathlib pickle platform posix pprint pwd queue random re reprlib resource
    sched secrets select selectors shlex shutil signal site socket ssl stat statistics string stringprep
    struct subprocess sys sysconfig tempfile textwrap threading time timeit token tokenize tomllib traceback
    types typing unicodedata unittest unittest.mock urllib.parse uuid warnings weakref zipimport zlib zoneinfo
""".split()  # noqa: SIM905 - easier to read than a hundred quoted words

CODECS = """
    ascii base64_codec charmap cp1252 hex_codec idna latin_1 punycode raw_unicode_escape rot_13 unicode_escape
    utf_16 utf_16_be utf_16_le utf_32 utf_7 utf_8 utf_8_sig
""".split()  # noqa: SIM905 - see above

IMPORTED = (*LISTED, "_strptime", *(f"encodings.{codec}" for codec in CODECS))
SOME_VERSIONS_HAVE = ("typing.io", "typing.re")


def load_stdlib(run: ProgramRun) -> None:
    """Import all modules that a program may import."""
    import select  # noqa: PLC0415 - see the module's first lines

    vars(select)["select"] = Select(run)
    simulate_chance()
    vars(_thread)["get_native_id"] = lambda: 1
    # The interpreter would specialize a hook after some dozens of forks, which would change the heap.
    os.register_at_fork = posix.register_at_fork = lambda **_: None
    sys.modules["_queue"] = None  # type: ignore[assignment]  # makes `queue` use its Python code, with simulated locks
    for name in IMPORTED:
        importlib.import_module(name)
    for name in (*SOME_VERSIONS_HAVE, "_queue"):
        sys.modules.pop(name, None)
    from codebotler.simulator.sandbox.dates import simulate_dates  # noqa: PLC0415 - see the module's first lines

    simulate_dates()
    simulate_identities()
    hide_folders()


def simulate_chance() -> None:
    """Make random numbers repeatable, even if a program asks for an unpredictable seed."""

    class Random(_random.Random):
        def __new__(cls, *_: object, **__: object) -> Self:
            return super().__new__(cls, 0)  # type: ignore[call-arg]  # a seed

        def __init__(self, *_: object, **__: object) -> None:
            self.seed()

        def seed(self, a: Any = None, /) -> None:  # noqa: ANN401 - as in _random
            super().seed(0 if a is None else a)

    _random.Random = Random  # type: ignore[misc]  # `random` uses this class
    source = Random()

    def urandom(size: int, /) -> bytes:
        return source.getrandbits(8 * size).to_bytes(size, "big") if size else b""

    os.urandom = posix.urandom = urandom


def simulate_identities() -> None:
    """Make `uuid` use the simulated clock, and hide this machine from `uuid` and `platform`."""
    import platform  # noqa: PLC0415 - see the module's first lines
    import uuid  # noqa: PLC0415 - see the module's first lines

    vars(platform).update(_uname_cache=platform.uname_result("Linux", "robot", "", "", ""))
    sys.orig_argv, sys.executable = list(sys.argv), ""
    vars(uuid).update(_generate_time_safe=None, _node=1)


def hide_folders() -> None:
    """Hide this machine's folders from modules and tracebacks."""
    for name, module in list(sys.modules.items()):
        if getattr(module, "__file__", None):
            module.__file__ = f"{name}.py"
            if module.__spec__ is not None:
                module.__spec__.origin = module.__file__
    import traceback  # noqa: PLC0415 - see the module's first lines

    summarise = traceback.FrameSummary.__init__

    def without_folder(self: traceback.FrameSummary, filename: str, *more: Any, **others: Any) -> None:  # noqa: ANN401 - as in `traceback`
        summarise(self, filename.rpartition("/")[2], *more, **others)

    traceback.FrameSummary.__init__ = without_folder  # type: ignore[method-assign]  # on purpose


class Select:
    """Replaces `select.select`: waiting for files is forbidden, and a wait without files is a sleep."""

    # This is a class, since a function would become a method in `selectors`.
    def __init__(self, run: ProgramRun) -> None:
        self.run = run

    def __call__(
        self, read: list[object], write: list[object], other: list[object], timeout: float | None = None, /
    ) -> tuple[list[object], list[object], list[object]]:
        """Let `timeout` simulated seconds pass, or end the run if there is no timeout."""
        if read or write or other:
            raise PermissionError(1, "Operation not permitted")
        if timeout is None:
            self.run.wait_for_ever()
        self.run.sleep(timeout)
        return [], [], []
