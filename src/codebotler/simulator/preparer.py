"""The preparer, seen from outside: turns programs into code that a child can run, each program once."""

from __future__ import annotations

import json
import socket
from collections import OrderedDict
from dataclasses import dataclass

from codebotler.simulator.child import Child, LostChildError, ProtocolError, cause_of_death
from codebotler.simulator.isolated import start
from codebotler.simulator.sandbox import IMPORTING, PREPARER, REFUSED
from codebotler.trace import Outcome, RunError, Status

MAX_SOURCE = 5_000_000
MAX_CODE = 100_000_000
LONG = 100_000  # characters of a program that is prepared in a process of its own
SERVES = 500  # programs that one process prepares
KEPT = 100  # programs whose code is kept


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
        if key not in self._kept:
            self._kept[key] = self._prepare(source, lowercase=lowercase)
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]

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

    def _prepare(self, source: str, *, lowercase: bool) -> Prepared | Outcome:
        if len(source) > LONG or self._served >= SERVES:
            self.close()
        try:
            return self._ask(source, lowercase=lowercase)
        except _DiedError as death:
            if death.served:  # perhaps it had grown tired of earlier programs: a verdict needs a fresh one
                return self._prepare(source, lowercase=lowercase)
            return Outcome(death.status, (), death.error)
        finally:
            if len(source) > LONG:
                self.close()

    def _ask(self, source: str, *, lowercase: bool) -> Prepared | Outcome:
        if self._child is None:
            self._child = _started()
        self._child.send((source, lowercase))
        served, self._served = self._served, self._served + 1
        try:
            answer = self._child.receive_bytes(MAX_CODE)
        except (TimeoutError, ProtocolError):
            answer = None
        if not answer:
            child, self._child, self._served = self._child, None, 0
            closed = child.was_closed()
            status = child.ended()
            if not closed:
                raise LostChildError("the preparer ended before it was closed")
            raise _DiedError(served, *cause_of_death(status))
        self._child.rest()
        if answer[:1] == REFUSED:
            return refused(*json.loads(answer[1:]))
        return Prepared(answer[1:], imports=answer[:1] == IMPORTING)


class _DiedError(Exception):
    def __init__(self, served: int, status: Status, error: RunError) -> None:
        self.served, self.status, self.error = served, status, error


def _started() -> Child:
    ours, theirs = socket.socketpair()
    with theirs:
        process = start(PREPARER, theirs.fileno())
    return Child(process.pid, ours, process.wait, closes=False)


def refused(kind: str, message: str, line: int | None = None) -> Outcome:
    """The outcome of a program that cannot be run."""
    return Outcome(Status.PYTHON_ERROR, (), RunError(kind, message), line)
