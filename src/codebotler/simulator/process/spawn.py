"""Starts isolated processes with our own code, by the interpreter that runs us."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from functools import cache
from typing import IO

from codebotler.simulator.process.bytecode import SANDBOX, code_of, compiled_modules
from codebotler.simulator.process.errors import LostProcessError
from codebotler.simulator.sandbox import FLAGS

CHILD_ENVIRONMENT = {
    "PYTHONHASHSEED": "0",
    "TZ": "UTC",
    "LC_ALL": "C.UTF-8",
    "PYTHONUTF8": "1",
    "LD_BIND_NOW": "1",
}


def start_fork_server(role: str, *descriptors: int) -> subprocess.Popen[bytes]:
    """Start a fork server with fixed addresses, and pass it descriptors and the code of its modules."""
    handed = (*descriptors, compiled_file().fileno())
    return _start([str(SANDBOX / "start.py"), role, *map(str, handed)], handed)


def start_module(code: str, arguments: Sequence[str], descriptors: Sequence[int]) -> subprocess.Popen[bytes]:
    """Start a process that runs a line of our code, which can import our modules, and pass it descriptors."""
    folders = [os.path.abspath(folder) for folder in sys.path]  # noqa: PTH100 - Path.resolve follows links
    setup = f"import sys; sys.path[:] = {folders!r}; {code}"
    return _start(["-c", setup, *arguments, *map(str, descriptors)], descriptors)


def _start(arguments: Sequence[str], descriptors: Sequence[int]) -> subprocess.Popen[bytes]:
    with START_LOCK:
        return subprocess.Popen(  # noqa: S603 - our own code, by the interpreter that runs us
            [sys.executable, *FLAGS, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env=CHILD_ENVIRONMENT,
            pass_fds=descriptors,
            start_new_session=True,
        )


START_LOCK = threading.Lock()
# A fork during a start would inherit a locked lock, and keep open a pipe that the start expects to close.
os.register_at_fork(
    before=START_LOCK.acquire,
    after_in_parent=START_LOCK.release,
    after_in_child=START_LOCK.release,
)


def compiled_file() -> IO[bytes]:
    """Return a file with the code of all modules of a fork server."""
    with START_LOCK:
        return _written_file()


@cache
def _written_file() -> IO[bytes]:
    codes = compiled_modules(code_of)
    file: IO[bytes] = (  # in memory if possible, since the disk may be full
        os.fdopen(os.memfd_create("codes"), "w+b") if sys.platform == "linux" else tempfile.TemporaryFile()  # noqa: SIM115 - see above
    )
    atexit.register(file.close)
    try:
        file.write(codes)
        file.flush()
    except OSError as error:  # the file size limit applies to files in memory as well
        raise LostProcessError(f"{error.strerror}; allow larger files with `ulimit -f unlimited`") from None
    return file
