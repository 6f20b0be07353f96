"""The engine's client of the preparer, which compiles programs and decides which are tame."""

from __future__ import annotations

import json
import signal
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from codebotler.core.trace import Outcome, RunError, Status
from codebotler.simulator.process.errors import LostProcessError, ProtocolError
from codebotler.simulator.process.exit_status import cause_of_death
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.process.spawn import start
from codebotler.simulator.sandbox import MAX_CODE, PLAIN, PREPARER, REFUSED, TAME

MAX_SOURCE = 5_000_000
LONG_SOURCE = 100_000  # characters; a longer program is prepared in its own process, a longer list one by one
MAX_PREPARED = 2_000  # programs per process
SkillNames: TypeAlias = tuple[str, ...]
EXHAUSTED = ("MemoryError", "TimeoutError", "Crash")


@dataclass(frozen=True)
class Prepared:
    """A program that was compiled successfully."""

    code: bytes  # marshalled; only a child may unmarshal it
    is_tame: bool  # whether it leaves nothing behind for later runs in its process


class Preparer:
    """Compiles programs in a closed process, which is replaced from time to time."""

    def __init__(self) -> None:
        self._process: IsolatedProcess | None = None
        self._served = 0
        self._asked: tuple[tuple[str, ...], bool, SkillNames] | None = None  # the pending request
        self._last: tuple[tuple[str, bool, SkillNames], Prepared | Outcome] | None = None

    def prepare(self, source: str, *, lowercase: bool, skills: SkillNames) -> Prepared | Outcome:
        """Compile a program, or return the outcome of all its runs if that fails. Cache the last result."""
        if len(source) > MAX_SOURCE:
            return refused("MemoryError", f"the program is longer than {MAX_SOURCE:,} characters")
        asked = source, lowercase, skills
        if self._last is None or self._last[0] != asked:
            self._last = asked, self._prepare(*asked)
        return self._last[1]

    def prepare_all(
        self, sources: Sequence[str], *, lowercase: bool, skills: SkillNames
    ) -> list[Prepared | Outcome]:
        """Prepare several programs as `prepare` does, together if they are short."""
        if len(sources) > 1 and sum(map(len, sources)) <= LONG_SOURCE:
            if self._served + len(sources) > MAX_PREPARED:
                self.close()
            results = self._ask(sources, lowercase, skills)
            if len(results) == len(sources) and not any(map(is_exhausted, results)):
                return results
        return [self.prepare(source, lowercase=lowercase, skills=skills) for source in sources]

    def ask_ahead(self, source: str, *, lowercase: bool, skills: SkillNames) -> None:
        """Start to compile the program of the next `prepare` in the background."""
        is_known = self._last is not None and self._last[0] == (source, lowercase, skills)
        if (
            not is_known
            and self._asked is None
            and self._served < MAX_PREPARED
            and len(source) <= LONG_SOURCE
        ):
            self._send((source,), lowercase, skills)

    def start(self) -> IsolatedProcess:
        """Return the process, and start it if there is none. It answers once it is ready."""
        if self._process is None:
            ours, theirs = socket.socketpair()
            with theirs:
                try:
                    process = start(PREPARER, theirs.fileno())
                except BaseException:
                    ours.close()
                    raise
            self._process = IsolatedProcess(lambda: process.pid, ours, process.wait, has_seccomp=False)
        return self._process

    def kill(self) -> None:
        """Kill the process, even while it compiles a program."""
        process = self._process  # another thread may set it to None
        if process is not None:
            process.kill()

    def close(self) -> None:
        """End the process. Call this only while nothing is running."""
        process, self._process, self._served, self._asked = self._process, None, 0, None
        if process is not None:
            process.end()

    def forget(self) -> None:
        """After a fork, close the channel in the new process, which is not the preparer's parent."""
        if self._process is not None:
            self._process.hang_up()

    def _prepare(self, source: str, lowercase: bool, skills: SkillNames) -> Prepared | Outcome:  # noqa: FBT001 - a private method
        if len(source) > LONG_SOURCE or self._served >= MAX_PREPARED:
            self.close()
        served = self._served
        try:
            (result,) = self._ask((source,), lowercase, skills)
            if served and is_exhausted(result):
                self.close()  # earlier programs may have exhausted it, so try a fresh one
                (result,) = self._ask((source,), lowercase, skills)
            return result
        finally:
            if len(source) > LONG_SOURCE:
                self.close()

    def _ask(self, sources: Sequence[str], lowercase: bool, skills: SkillNames) -> list[Prepared | Outcome]:  # noqa: FBT001 - a private method
        """Return the results for programs, up to the program at which the process ended."""
        asked = tuple(sources), lowercase, skills
        if self._asked is not None and self._asked != asked:  # discard the results of an unused request
            self._answers(len(self._asked[0]))
        if self._asked is None:
            self._send(*asked)
        return self._answers(len(sources))

    def _send(self, sources: tuple[str, ...], lowercase: bool, skills: SkillNames) -> None:  # noqa: FBT001 - a private method
        self.start().send((sources, lowercase, skills), at_once=True)
        self._asked = sources, lowercase, skills
        self._served += len(sources)

    def _answers(self, count: int) -> list[Prepared | Outcome]:
        process = self.start()
        self._asked = None
        results: list[Prepared | Outcome] = []
        for _ in range(count):
            try:
                answer = process.receive_bytes(len(PLAIN) + MAX_CODE)
            except (TimeoutError, ProtocolError):
                answer = None
            if not answer:
                self._process, self._served = None, 0
                status = process.end_gently()
                if status == -signal.SIGKILL:
                    raise LostProcessError("the preparer was killed from outside")
                cause, error = cause_of_death(status)
                return [*results, Outcome(cause, (), error)]
            results.append(result_of(answer))
        process.reset_patience()
        return results


def result_of(answer: bytes) -> Prepared | Outcome:
    """Parse an answer of the process."""
    if answer[:1] == REFUSED:
        return refused(*json.loads(answer[1:]))
    return Prepared(answer[1:], is_tame=answer[:1] == TAME)


def is_exhausted(result: Prepared | Outcome) -> bool:
    """Return whether this program or an earlier one exhausted the process."""
    return isinstance(result, Outcome) and result.error is not None and result.error.kind in EXHAUSTED


def refused(kind: str, message: str, line: int | None = None) -> Outcome:
    """Return the outcome of a program that cannot be compiled."""
    return Outcome(Status.PYTHON_ERROR, (), RunError(kind, message), line)
