"""Starts an isolated process: our own script under a bare interpreter, with nothing but a few pipes."""

from __future__ import annotations

import importlib
import inspect
import marshal
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import BinaryIO

from codebotler.simulator.sandbox import FLAGS

SANDBOX = Path(__file__).with_name("sandbox")


def start(role: str, *descriptors: int) -> subprocess.Popen[bytes]:
    """Start one.

    Args:
        role: what it is to be.
        descriptors: what it is handed.
    """
    handed = (codes().fileno(), *descriptors)
    return subprocess.Popen(  # noqa: S603 - our own file, by the interpreter that runs us
        [sys.executable, *FLAGS, str(SANDBOX / "start.py"), role, *map(str, handed)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd="/",
        env={"PYTHONHASHSEED": "0", "TZ": "UTC", "LC_ALL": "C.UTF-8", "PYTHONUTF8": "1", "LD_BIND_NOW": "1"},
        pass_fds=handed,
        start_new_session=True,
    )


@cache
def codes() -> BinaryIO:
    """A file with the code of the modules that isolated processes run, by name."""
    simulator, package = __package__, __package__ + ".sandbox"
    sources = dict.fromkeys((simulator.partition(".")[0], simulator), "")
    sources[package] = (SANDBOX / "__init__.py").read_text(encoding="utf-8")
    for path in sorted(SANDBOX.glob("[a-z]*.py")):
        sources[f"{package}.{path.stem}"] = path.read_text(encoding="utf-8")
    for name in NEEDED:
        sources[name] = inspect.getsource(importlib.import_module(name))
    file = tempfile.TemporaryFile()  # noqa: SIM115 - there as long as this process
    file.write(marshal.dumps({name: code_of(source, name) for name, source in sources.items()}))
    file.flush()
    return file


NEEDED = ("__future__", "types")


def code_of(source: str, name: str) -> bytes:
    """The code of one module."""
    return marshal.dumps(compile(source, f"<{name}>", "exec", dont_inherit=True), 2)
