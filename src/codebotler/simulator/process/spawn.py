"""Starts isolated processes, each with the compiled code of its role."""

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
from codebotler.simulator.sandbox import BATCH_SERVER, FLAGS, FORK_SERVER, LIVE_SERVER, PREPARER

MODULES = {PREPARER: f"{SIMULATOR}.sandbox.preparer", BATCH_SERVER: f"{BATCHES}.process"}


def start(role: str, *descriptors: int) -> subprocess.Popen[bytes]:
    """Start a process in one of the roles, and hand it descriptors."""
    handed = (compiled_file(role).fileno(), *descriptors)
    module = MODULES.get(role, f"{SIMULATOR}.sandbox.fork_server")
    with ONE_AT_A_TIME:
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


ONE_AT_A_TIME = threading.Lock()
# Who forks this process in the middle of a start would get half of it: a lock that nobody opens, and the end
# of a pipe on whose closing the start waits.
os.register_at_fork(
    before=ONE_AT_A_TIME.acquire,
    after_in_parent=ONE_AT_A_TIME.release,
    after_in_child=ONE_AT_A_TIME.release,
)


def compiled_file(role: str) -> IO[bytes]:
    """A file with the code of the modules that a process in one of the roles runs."""
    with ONE_AT_A_TIME:
        return _written_file(FORK_SERVER if role == LIVE_SERVER else role)


@cache
def _written_file(role: str) -> IO[bytes]:
    codes = compiled_modules(compiled, role)
    file: IO[bytes] = (  # closed at the end of this process; in memory if possible, since a disk may be full
        os.fdopen(os.memfd_create("codes"), "w+b") if sys.platform == "linux" else tempfile.TemporaryFile()  # noqa: SIM115 - see above
    )
    atexit.register(file.close)
    try:
        file.write(codes)
        file.flush()
    except OSError as error:  # a limit on the size of files holds in memory, too
        raise LostProcessError(f"{error.strerror}; allow larger files with `ulimit -f unlimited`") from None
    return file
