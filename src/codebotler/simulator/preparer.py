"""The engine's handle on the preparer: sends it a program, gets its code back, and whether it is tame."""

from __future__ import annotations

import json
import signal
import socket
from dataclasses import dataclass
from typing import TypeAlias

from codebotler.core.trace import Outcome, RunError, Status
from codebotler.simulator.isolated_process import (
    IsolatedProcess,
    LostProcessError,
    ProtocolError,
    cause_of_death,
    start,
)
from codebotler.simulator.sandbox import MAX_CODE, PLAIN, PREPARER, REFUSED, TAME

MAX_SOURCE = 5_000_000
LONG = 100_000  # characters of a program that is prepared in a process of its own
SERVES = 500  # programs that one process prepares
Skills: TypeAlias = tuple[str, ...]  # the names of those that a program may call
EXHAUSTED = ("MemoryError", "TimeoutError", "Crash")


@dataclass(frozen=True)
class Prepared:
    """A program that parses."""

    code: bytes  # marshalled; only a child may open it
    is_tame: bool  # nothing that it does can be felt by another run in the same process


class Preparer:
    """A closed process that parses and compiles programs, and is replaced now and then."""

    def __init__(self) -> None:
        self._process: IsolatedProcess | None = None
        self._served = 0
        self._last: tuple[tuple[str, bool, Skills], Prepared | Outcome] | None = None

    def prepare(self, source: str, *, lowercase: bool, skills: Skills) -> Prepared | Outcome:
        """A program's code, or the outcome of all its runs where it has none; the last one is kept."""
        if len(source) > MAX_SOURCE:
            return refused("MemoryError", f"the program is longer than {MAX_SOURCE:,} characters")
        asked = source, lowercase, skills
        if self._last is None or self._last[0] != asked:
            self._last = asked, self._prepare(*asked)
        return self._last[1]

    def start(self) -> IsolatedProcess:
        """The process, started now if there is none; what is sent to it waits until it is ready."""
        if self._process is None:
            ours, theirs = socket.socketpair()
            with theirs:
                process = start(PREPARER, theirs.fileno())
            self._process = IsolatedProcess(lambda: process.pid, ours, process.wait, has_seccomp=False)
        return self._process

    def kill(self) -> None:
        """End the process, also in the middle of a program."""
        process = self._process
        if process is not None:
            process.kill()

    def close(self) -> None:
        """End the process; nothing may be running."""
        process, self._process, self._served = self._process, None, 0
        if process is not None:
            process.end()

    def forget(self) -> None:
        """Close its channel in a forked process, whose child it is not."""
        if self._process is not None:
            self._process.hang_up()

    def _prepare(self, source: str, lowercase: bool, skills: Skills) -> Prepared | Outcome:  # noqa: FBT001 - private
        if len(source) > LONG or self._served >= SERVES:
            self.close()
        served = self._served
        try:
            result = self._ask((source, lowercase, skills))
            if served and isinstance(result, Outcome) and result.error and result.error.kind in EXHAUSTED:
                self.close()  # perhaps earlier programs had exhausted it: a verdict needs a fresh one
                result = self._ask((source, lowercase, skills))
            return result
        finally:
            if len(source) > LONG:
                self.close()

    def _ask(self, asked: tuple[str, bool, Skills]) -> Prepared | Outcome:
        process = self.start()
        process.send(asked)
        self._served += 1
        try:
            answer = process.receive_bytes(len(PLAIN) + MAX_CODE)
        except (TimeoutError, ProtocolError):
            answer = None
        if not answer:
            self._process, self._served = None, 0
            status = process.ended()
            if status == -signal.SIGKILL:
                raise LostProcessError("the preparer was killed from outside")
            cause, error = cause_of_death(status)
            return Outcome(cause, (), error)
        process.reset_patience()
        if answer[:1] == REFUSED:
            return refused(*json.loads(answer[1:]))
        return Prepared(answer[1:], is_tame=answer[:1] == TAME)


def refused(kind: str, message: str, line: int | None = None) -> Outcome:
    """The outcome of a program that cannot be run."""
    return Outcome(Status.PYTHON_ERROR, (), RunError(kind, message), line)
