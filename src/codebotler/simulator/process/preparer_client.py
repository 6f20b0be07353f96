"""The engine's handle on the preparer, which compiles programs and decides which are tame."""

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
LONG_SOURCE = (
    100_000  # characters: a longer program is prepared in a process of its own, more of them one by one
)
MAX_PREPARED = 2_000  # programs for each process
SkillNames: TypeAlias = tuple[str, ...]  # names
EXHAUSTED = ("MemoryError", "TimeoutError", "Crash")


@dataclass(frozen=True)
class Prepared:
    """A program that parses."""

    code: bytes  # marshalled; only a child may open it
    is_tame: bool  # it leaves nothing behind for later runs in its process


class Preparer:
    """A closed process that parses and compiles programs, replaced from time to time."""

    def __init__(self) -> None:
        self._process: IsolatedProcess | None = None
        self._served = 0
        self._asked: tuple[tuple[str, ...], bool, SkillNames] | None = None  # the open request
        self._last: tuple[tuple[str, bool, SkillNames], Prepared | Outcome] | None = None

    def prepare(self, source: str, *, lowercase: bool, skills: SkillNames) -> Prepared | Outcome:
        """A program's code, or the outcome of all its runs if it has none; the last answer is cached."""
        if len(source) > MAX_SOURCE:
            return refused("MemoryError", f"the program is longer than {MAX_SOURCE:,} characters")
        asked = source, lowercase, skills
        if self._last is None or self._last[0] != asked:
            self._last = asked, self._prepare(*asked)
        return self._last[1]

    def prepare_all(
        self, sources: Sequence[str], *, lowercase: bool, skills: SkillNames
    ) -> list[Prepared | Outcome]:
        """The code or outcome of several programs, prepared together if they are short."""
        if len(sources) > 1 and sum(map(len, sources)) <= LONG_SOURCE:
            if self._served + len(sources) > MAX_PREPARED:
                self.close()
            results = self._ask(sources, lowercase, skills)
            if len(results) == len(sources) and not any(map(is_exhausted, results)):
                return results
        return [self.prepare(source, lowercase=lowercase, skills=skills) for source in sources]

    def ask_ahead(self, source: str, *, lowercase: bool, skills: SkillNames) -> None:
        """Begin with the program of the next `prepare`."""
        is_known = self._last is not None and self._last[0] == (source, lowercase, skills)
        if (
            not is_known
            and self._asked is None
            and self._served < MAX_PREPARED
            and len(source) <= LONG_SOURCE
        ):
            self._send((source,), lowercase, skills)

    def start(self) -> IsolatedProcess:
        """The process, started now if there is none; it answers once it is ready."""
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
        """End the process, also in the middle of a program."""
        process = self._process  # another thread may close it
        if process is not None:
            process.kill()

    def close(self) -> None:
        """End the process; nothing may be running."""
        process, self._process, self._served, self._asked = self._process, None, 0, None
        if process is not None:
            process.end()

    def forget(self) -> None:
        """Close its channel in a forked process, whose child it is not."""
        if self._process is not None:
            self._process.hang_up()

    def _prepare(self, source: str, lowercase: bool, skills: SkillNames) -> Prepared | Outcome:  # noqa: FBT001 - private
        if len(source) > LONG_SOURCE or self._served >= MAX_PREPARED:
            self.close()
        served = self._served
        try:
            (result,) = self._ask((source,), lowercase, skills)
            if served and is_exhausted(result):
                self.close()  # earlier programs may have exhausted it: only a fresh one can judge
                (result,) = self._ask((source,), lowercase, skills)
            return result
        finally:
            if len(source) > LONG_SOURCE:
                self.close()

    def _ask(self, sources: Sequence[str], lowercase: bool, skills: SkillNames) -> list[Prepared | Outcome]:  # noqa: FBT001 - private
        """The results for programs, up to the one at which the process ended."""
        asked = tuple(sources), lowercase, skills
        if self._asked is not None and self._asked != asked:  # for a program that was not run
            self._answers(len(self._asked[0]))
        if self._asked is None:
            self._send(*asked)
        return self._answers(len(sources))

    def _send(self, sources: tuple[str, ...], lowercase: bool, skills: SkillNames) -> None:  # noqa: FBT001 - private
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
    """The result in an answer of the process."""
    if answer[:1] == REFUSED:
        return refused(*json.loads(answer[1:]))
    return Prepared(answer[1:], is_tame=answer[:1] == TAME)


def is_exhausted(result: Prepared | Outcome) -> bool:
    """Whether this program, or earlier ones, exhausted the process."""
    return isinstance(result, Outcome) and result.error is not None and result.error.kind in EXHAUSTED


def refused(kind: str, message: str, line: int | None = None) -> Outcome:
    """The outcome of a program that cannot run."""
    return Outcome(Status.PYTHON_ERROR, (), RunError(kind, message), line)
