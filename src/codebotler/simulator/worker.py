"""A worker: the processes that run programs one at a time: a preparer and two fork servers."""

from __future__ import annotations

import logging
import os
import zlib
from collections.abc import Callable

from codebotler.core.trace import Outcome
from codebotler.simulator.child import LostChildError
from codebotler.simulator.fork_server import ForkServer
from codebotler.simulator.preparer import Prepared, Preparer
from codebotler.simulator.sandbox import FORK_SERVER, LIBRARY_SERVER, LIVE_SERVER
from codebotler.simulator.skill_protocol import ImportsMoreError, Robot, SkillProtocol

EVENTS = logging.getLogger("codebotler.engine.events")
"""What happens to each run: started, how it ended and why; at level DEBUG, so that it is off by default."""


class Worker:
    """What runs programs one at a time.

    Nearly all programs import nothing. They run in children of a fork server that is small, and cheap to
    fork; the others in those of one that has the standard library, which is started when the first of them
    comes.

    Raises:
        EngineError: the processes cannot be started.
    """

    def __init__(self) -> None:
        self._stopped = False
        self._preparer = Preparer()
        self._preparer.start()  # beside the fork server
        self._fork_servers: dict[str, ForkServer] = {}
        try:
            self.has_seccomp = self._fork_server(FORK_SERVER).has_seccomp
        except LostChildError as error:
            self._preparer.close()
            raise EngineError(f"the engine does not start: {error}") from None
        except BaseException:  # an interrupt
            self._preparer.close()
            raise

    def run(self, source: str, new_robot: Callable[[], Robot]) -> Outcome:
        """Run a program with a robot, once more if a process was lost through no fault of the program.

        Args:
            source: the program, which need not even parse.
            new_robot: makes the robot who executes its skills, in the initial state of its world.

        Raises:
            EngineError: a process was lost twice, or the worker was stopped.
        """
        name = zlib.crc32(source.encode(errors="surrogatepass"))
        EVENTS.debug("program %08x: started", name)
        try:
            outcome = self._try(source, new_robot)
        except LostChildError as first:
            EVENTS.debug("program %08x: a process was lost, and it is run again: %s", name, first)
            try:
                outcome = self._try(source, new_robot)
            except LostChildError as error:
                raise EngineError(f"an isolated process was lost twice: {error}") from None
        why = "" if outcome.error is None else f" ({outcome.error.kind}: {outcome.error.message!a})"
        EVENTS.debug("program %08x: %s%s", name, outcome.status.value, why)
        return outcome

    def run_live(self, source: str, robot: Robot) -> Outcome:
        """Run a program on a robot, once and never again: what that has done cannot be undone.

        Args:
            source: the program, which need not even parse.
            robot: who executes its skills; what it raises besides `RobotError` ends the run and is thrown.

        Raises:
            EngineError: a process was lost, or the worker was stopped.
        """
        try:
            prepared = self._preparer.prepare(source, lowercase=robot.rules.literals == "lowercase")
            return prepared if isinstance(prepared, Outcome) else self._converse(LIVE_SERVER, prepared, robot)
        except LostChildError as error:
            self.close()
            stopped = "the engine was stopped" if self._stopped else f"an isolated process was lost: {error}"
            raise EngineError(stopped) from None

    def stop(self) -> None:
        """End all processes and with them a run that is still going on; its thread notices."""
        self._stopped = True
        self._preparer.kill()
        for fork_server in list(self._fork_servers.values()):
            fork_server.kill()

    def stay_on(self, core: int) -> None:
        """Let the processes run on one core only."""
        for fork_server in self._fork_servers.values():
            os.sched_setaffinity(fork_server.pid, {core})

    def close(self) -> None:
        """Give back all that the worker holds; nothing may be running."""
        self._preparer.close()
        while self._fork_servers:
            self._fork_servers.popitem()[1].close()

    def forget(self) -> None:
        """Close what a forked process has inherited, and let the processes be, which are not its own."""
        self._preparer.forget()
        while self._fork_servers:
            self._fork_servers.popitem()[1].forget()

    def _try(self, source: str, new_robot: Callable[[], Robot]) -> Outcome:
        try:
            robot = new_robot()
            prepared = self._preparer.prepare(source, lowercase=robot.rules.literals == "lowercase")
            if isinstance(prepared, Outcome):
                return prepared
            if prepared.imports:
                return self._converse(LIBRARY_SERVER, prepared, robot)
            try:
                return self._converse(FORK_SERVER, prepared, robot)
            except ImportsMoreError as error:
                return self._converse(LIBRARY_SERVER, prepared, new_robot(), patience=error.patience)
        except (LostChildError, OSError) as error:
            if self._stopped:
                raise EngineError("the engine was stopped") from None
            self.close()
            raise LostChildError(str(error)) from None

    def _converse(
        self, role: str, prepared: Prepared, robot: Robot, *, patience: float | None = None
    ) -> Outcome:
        child = self._fork_server(role).fork()
        if patience is not None:
            child.patience = patience
        return SkillProtocol(child, prepared.code, robot, may_import=role != FORK_SERVER).outcome()

    def _fork_server(self, role: str) -> ForkServer:
        if role not in self._fork_servers:
            self._fork_servers[role] = ForkServer(role)
            if self._stopped:
                self._fork_servers[role].kill()
        return self._fork_servers[role]


class EngineError(RuntimeError):
    """The engine itself failed; no verdict on a program can be drawn from it."""
