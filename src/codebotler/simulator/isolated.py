"""Starts an isolated process: our own script under a bare interpreter, with nothing but a few pipes."""

from __future__ import annotations

import atexit
import importlib
import inspect
import marshal
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import IO

from codebotler.simulator.sandbox import FLAGS, WITHOUT_REFERENCES

SANDBOX = Path(__file__).with_name("sandbox")


def start(role: str, *descriptors: int) -> subprocess.Popen[bytes]:
    """Start one.

    Args:
        role: what it is to be.
        descriptors: what it is handed.
    """
    handed = (codes().fileno(), *descriptors)
    with ONE_AT_A_TIME:
        return subprocess.Popen(  # noqa: S603 - our own file, by the interpreter that runs us
            [sys.executable, *FLAGS, str(SANDBOX / "start.py"), role, *map(str, handed)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env={
                "PYTHONHASHSEED": "0",
                "TZ": "UTC",
                "LC_ALL": "C.UTF-8",
                "PYTHONUTF8": "1",
                "LD_BIND_NOW": "1",
            },
            pass_fds=handed,
            start_new_session=True,
        )


def codes() -> IO[bytes]:
    """A file with the code of the modules that isolated processes run, by name."""
    with ONE_AT_A_TIME:
        return written_codes()


ONE_AT_A_TIME = threading.Lock()
# Who forks this process in the middle of a start would get half of it: a lock that nobody opens, and the end
# of a pipe on whose closing the start waits.
os.register_at_fork(
    before=ONE_AT_A_TIME.acquire,
    after_in_parent=ONE_AT_A_TIME.release,
    after_in_child=ONE_AT_A_TIME.release,
)


@cache
def written_codes() -> IO[bytes]:
    """Make the file, in memory where the system can do that: a disk may be full."""
    file: IO[bytes] = (  # closed at the end of this process
        os.fdopen(os.memfd_create("codes"), "w+b") if sys.platform == "linux" else tempfile.TemporaryFile()  # noqa: SIM115 - see above
    )
    atexit.register(file.close)
    file.write(written(code_of))
    file.flush()
    return file


def written(code_of: Callable[[str, str], bytes]) -> bytes:
    """The codes of all modules that isolated processes run, by name, as one message.

    Args:
        code_of: compiles the source of a module, given its name.
    """
    simulator, package = __package__, __package__ + ".sandbox"
    sources = dict.fromkeys((simulator.partition(".")[0], simulator), "")
    sources[package] = (SANDBOX / "__init__.py").read_text(encoding="utf-8")
    for path in sorted(SANDBOX.glob("[a-z]*.py")):
        sources[f"{package}.{path.stem}"] = path.read_text(encoding="utf-8")
    for name in NEEDED:
        sources[name] = inspect.getsource(importlib.import_module(name))
    codes = {name: code_of(source, name) for name, source in sources.items()}
    return marshal.dumps(codes, WITHOUT_REFERENCES)


NEEDED = ("__future__", "types")


def code_of(source: str, name: str) -> bytes:
    """The code of one module."""
    return marshal.dumps(
        compile(source, f"<{name}>", "exec", dont_inherit=True, optimize=0), WITHOUT_REFERENCES
    )
