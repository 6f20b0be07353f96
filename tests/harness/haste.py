"""An early end for programs that would use up all their processor time, as the kernel's signal ends them."""

from __future__ import annotations

import os
import re
import signal
import socket
import struct
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from codebotler.simulator.process.isolated_process import SILENCE_SECONDS, IsolatedProcess
from codebotler.simulator.sandbox import BATCH_CPU_SECONDS, CPU_SECONDS
from processor_time import used_by

LIMIT = re.compile(r"^Max cpu time +(\S+) +(\S+)", re.MULTILINE)
ENOUGH = 0.2
"""Seconds of silence after which a process is examined, and of processor time after which it is ended."""


def hasten(patch: pytest.MonkeyPatch) -> None:
    """On Linux, let a process that computes in silence soon have reached its limit, which it must have."""
    if sys.platform != "linux":
        return
    receive: Callable[[IsolatedProcess, int], bytes | None] = IsolatedProcess.receive_bytes
    examine: Callable[[IsolatedProcess, int | None], int | None] = IsolatedProcess._check_progress

    def receive_impatiently(process: IsolatedProcess, most: int) -> bytes | None:
        wait_for(process, ENOUGH)
        try:
            return receive(process, most)
        finally:
            wait_for(process, SILENCE_SECONDS)

    def end_and_examine(process: IsolatedProcess, before: int | None) -> int | None:
        soft, hard = LIMIT.findall(Path(f"/proc/{process.pid}/limits").read_text())[0]
        if soft != "unlimited" and used_by(process.pid) >= ENOUGH:  # otherwise it is not isolated, or waits
            assert int(hard) - 1 == int(soft) in {BATCH_CPU_SECONDS, CPU_SECONDS}
            os.kill(process.pid, signal.SIGXCPU)
        return examine(process, before)

    patch.setattr(IsolatedProcess, "receive_bytes", receive_impatiently)
    patch.setattr(IsolatedProcess, "_check_progress", end_and_examine)


def wait_for(process: IsolatedProcess, seconds: float) -> None:
    """Let a wait for a message end after so many seconds, unless the channel is closed."""
    limit = struct.pack("ll", int(seconds), round(seconds % 1 * 1e6))
    with suppress(OSError):
        process._channel.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, limit)
