"""Starts an isolated process: our own script under a bare interpreter, with nothing but a few pipes."""

from __future__ import annotations

import subprocess
import sys

from codebotler.simulator.sandbox import FLAGS, START


def start(role: str, *descriptors: int) -> subprocess.Popen[bytes]:
    """Start one.

    Args:
        role: what it is to be.
        descriptors: what it is handed.
    """
    return subprocess.Popen(  # noqa: S603 - our own file, by the interpreter that runs us
        [sys.executable, *FLAGS, START, role, *map(str, descriptors)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd="/",
        env={"PYTHONHASHSEED": "0", "TZ": "UTC", "LC_ALL": "C.UTF-8", "PYTHONUTF8": "1", "LD_BIND_NOW": "1"},
        pass_fds=descriptors,
        start_new_session=True,
    )
