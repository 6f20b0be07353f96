"""An early end for programs that would use up all their processor time, as the kernel's signal ends them."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.sandbox import BATCH_CPU_SECONDS, CPU_SECONDS

LIMIT = re.compile(r"^Max cpu time +(\S+) +(\S+)", re.MULTILINE)


def hasten(patch: pytest.MonkeyPatch) -> None:
    """On Linux, let a process that is silent for a second have reached its time limit, which it must have."""
    if sys.platform != "linux":
        return
    examine: Callable[[IsolatedProcess, int | None], int | None] = IsolatedProcess._check_progress

    def end_and_examine(process: IsolatedProcess, before: int | None) -> int | None:
        soft, hard = LIMIT.findall(Path(f"/proc/{process.pid}/limits").read_text())[0]
        if soft != "unlimited":  # otherwise it is not yet isolated
            assert int(hard) - 1 == int(soft) in {BATCH_CPU_SECONDS, CPU_SECONDS}
            os.kill(process.pid, signal.SIGXCPU)
        return examine(process, before)

    patch.setattr(IsolatedProcess, "_check_progress", end_and_examine)
