"""Errors of isolated processes and of the engine that starts them, and why a process died."""

from __future__ import annotations

import signal

from codebotler.core.trace import RunError, Status
from codebotler.simulator.sandbox import CPU_SECONDS

PROCESSOR_TIME = "seconds of processor time"  # ends the message about a program that used too much of it


class EngineError(RuntimeError):
    """The engine that runs programs failed, through no fault of a program."""


class LostProcessError(Exception):
    """A process ended through no fault of the program, for example before it was isolated."""


class ProtocolError(Exception):
    """A process sent an invalid message, which our code never does, so the program must have sent it."""


def cause_of_death(status: int, seconds: int = CPU_SECONDS) -> tuple[Status, RunError]:
    """Return why a process died. `status` is its exit status or negative signal, `seconds` its CPU limit."""
    match -status:
        case signal.SIGXCPU:
            return Status.TIMEOUT, RunError("TimeoutError", f"{seconds:,} {PROCESSOR_TIME}")
        case signal.SIGSYS:
            return Status.KILLED, RunError("ForbiddenCall", "the program made a forbidden system call")
        case signal.SIGKILL:
            return Status.KILLED, RunError("MemoryError", "the process was killed from outside")
    how = f"signal {-status}" if status < 0 else f"exit status {status}"
    return Status.KILLED, RunError("Crash", f"the process ended by itself ({how})")
