"""The preparer, seen from outside: turns programs into code that a child can run, each program once."""

from __future__ import annotations

import json
import signal
import socket
from collections import OrderedDict
from dataclasses import dataclass

from codebotler.core.trace import Outcome, RunError, Status
from codebotler.simulator.child import Child, LostChildError, ProtocolError, cause_of_death
from codebotler.simulator.isolated import start
from codebotler.simulator.sandbox import IMPORTING, MAX_CODE, PREPARER, REFUSED

MAX_SOURCE = 5_000_000
LONG = 100_000  # characters of a program that is prepared in a process of its own
SERVES = 500  # programs that one process prepares
KEPT = 100  # programs whose code is kept
EXHAUSTED = ("MemoryError", "TimeoutError", "Crash")
SMALL = 100_000  # bytes of code that is worth keeping


@dataclass(frozen=True)
class Prepared:
    """A program that parses.

    Args:
        code: marshalled; only a closed child may open it.
        imports: whether it imports more than is always there.
    """

    code: bytes
    imports: bool


class Preparer:
    """A closed process that parses and compiles programs."""

    def __init__(self) -> None:
        self._child: Child | None = None
        self._served = 0
        self._kept: OrderedDict[tuple[str, bool], Prepared | Outcome] = OrderedDict()

    def prepare(self, source: str, *, lowercase: bool) -> Prepared | Outcome:
        """A program's code; or the outcome of its runs, where it is no program.

        Args:
            source: of the program.
            lowercase: whether its literals are lowered.

        Raises:
            LostChildError: the process was lost through no fault of the program.
        """
        if len(source) > MAX_SOURCE:
            return refused("MemoryError", f"the program is longer than {MAX_SOURCE:,} characters")
        key = source, lowercase
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        prepared = self._prepare(source, lowercase=lowercase)
        if len(source) <= SMALL and (isinstance(prepared, Outcome) or len(prepared.code) <= SMALL):
            self._kept[key] = prepared
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return prepared

    def start(self) -> Child:
        """The process, started now if there is none; what is sent to it waits until it is ready."""
        if self._child is None:
            self._child = _started()
        return self._child

    def kill(self) -> None:
        """End the process, also in the middle of a program."""
        child = self._child
        if child is not None:
            child.kill()

    def close(self) -> None:
        """Give back all that it holds."""
        child, self._child, self._served = self._child, None, 0
        if child is not None:
            child.end()

    def forget(self) -> None:
        """Close its line in a forked process, whose child it is not."""
        if self._child is not None:
            self._child.hang_up()

    def _prepare(self, source: str, *, lowercase: bool) -> Prepared | Outcome:
        if len(source) > LONG or self._served >= SERVES:
            self.close()
        served = self._served
        try:
            outcome = self._ask_or_die(source, lowercase=lowercase)
            if served and isinstance(outcome, Outcome) and outcome.error and outcome.error.kind in EXHAUSTED:
                self.close()  # perhaps earlier programs had exhausted it: a verdict needs a fresh one
                outcome = self._ask_or_die(source, lowercase=lowercase)
            return outcome
        finally:
            if len(source) > LONG:
                self.close()

    def _ask_or_die(self, source: str, *, lowercase: bool) -> Prepared | Outcome:
        try:
            return self._ask(source, lowercase=lowercase)
        except _DiedError as death:
            return Outcome(death.status, (), death.error)

    def _ask(self, source: str, *, lowercase: bool) -> Prepared | Outcome:
        child = self.start()
        child.send((source, lowercase))
        self._served += 1
        try:
            answer = child.receive_bytes(len(IMPORTING) + MAX_CODE)
        except (TimeoutError, ProtocolError):
            answer = None
        if not answer:
            self._child, self._served = None, 0
            closed = child.was_closed()
            status = child.ended()
            if not closed:
                raise LostChildError("the preparer ended before it was closed")
            if status == -signal.SIGKILL:
                raise LostChildError("the preparer was killed from outside")
            raise _DiedError(*cause_of_death(status))
        child.rest()
        if answer[:1] == REFUSED:
            return refused(*json.loads(answer[1:]))
        return Prepared(answer[1:], imports=answer[:1] == IMPORTING)


class _DiedError(Exception):
    def __init__(self, status: Status, error: RunError) -> None:
        self.status, self.error = status, error


def _started() -> Child:
    ours, theirs = socket.socketpair()
    with theirs:
        process = start(PREPARER, theirs.fileno())
    return Child(lambda: process.pid, ours, process.wait, closes=False)


def refused(kind: str, message: str, line: int | None = None) -> Outcome:
    """The outcome of a program that cannot be run."""
    return Outcome(Status.PYTHON_ERROR, (), RunError(kind, message), line)
