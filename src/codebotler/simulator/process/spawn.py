"""Starts fork servers, each with the compiled code for its role."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
import tempfile
import threading
from functools import cache
from typing import IO

from codebotler.simulator.process.bytecode import BATCHES, SANDBOX, SIMULATOR, compiled, compiled_modules
from codebotler.simulator.process.errors import LostProcessError
from codebotler.simulator.sandbox import BATCH_SERVER, FLAGS, FORK_SERVER, LIVE_SERVER


def start(role: str, *descriptors: int) -> subprocess.Popen[bytes]:
    """Start a process in a role, and pass it descriptors."""
    handed = (compiled_file(role).fileno(), *descriptors)
    module = f"{BATCHES}.process" if role == BATCH_SERVER else f"{SIMULATOR}.sandbox.fork_server"
    with START_LOCK:
        return subprocess.Popen(  # noqa: S603 - our own file, by the interpreter that runs us
            [sys.executable, *FLAGS, str(SANDBOX / "start.py"), module, role, *map(str, handed)],
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


START_LOCK = threading.Lock()
# A fork during a start would inherit a locked lock, and keep open a pipe that the start expects to close.
os.register_at_fork(
    before=START_LOCK.acquire,
    after_in_parent=START_LOCK.release,
    after_in_child=START_LOCK.release,
)


def compiled_file(role: str) -> IO[bytes]:
    """Return a file with the code of all modules for a role."""
    with START_LOCK:
        return _written_file(FORK_SERVER if role == LIVE_SERVER else role)


@cache
def _written_file(role: str) -> IO[bytes]:
    codes = compiled_modules(compiled, role)
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
