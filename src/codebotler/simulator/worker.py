"""A worker: a preparer and fork servers, which run programs one at a time."""

from __future__ import annotations

import logging
import os
import zlib
from collections.abc import Callable

from codebotler.core.trace import Outcome
from codebotler.simulator.fork_server import ForkServer
from codebotler.simulator.isolated_process import LostProcessError
from codebotler.simulator.ledger import SkillPerformer
from codebotler.simulator.preparer import Prepared, Preparer
from codebotler.simulator.sandbox import FORK_SERVER, LIBRARY_SERVER, LIVE_SERVER
from codebotler.simulator.skill_protocol import ImportsMoreError, SkillProtocol

EVENTS = logging.getLogger("codebotler.engine.events")  # each run: started, how it ended and why; at DEBUG


class Worker:
    """The processes that run programs one at a time.

    Nearly all programs import nothing. They run in children of a fork server that is small and cheap to fork,
    the others in those of one that has the standard library, which is started when the first of them comes.
    """

    def __init__(self) -> None:
        self._stopped = False
        self._preparer = Preparer()
        self._preparer.start()  # beside the fork server
        self._fork_servers: dict[str, ForkServer] = {}
        try:
            self.has_seccomp = self._fork_server(FORK_SERVER).has_seccomp
        except LostProcessError as error:
            self._preparer.close()
            raise EngineError(f"the engine cannot start: {error}") from None
        except BaseException:  # an interrupt
            self._preparer.close()
            raise

    def run(self, source: str, new_robot: Callable[[], SkillPerformer]) -> Outcome:
        """Run a program, once more with a new robot if a process was lost through no fault of the program."""
        name = zlib.crc32(source.encode(errors="surrogatepass"))
        EVENTS.debug("program %08x: started", name)
        try:
            outcome = self._try(source, new_robot)
        except LostProcessError as first:
            EVENTS.debug("program %08x: a process was lost, and it is run again: %s", name, first)
            try:
                outcome = self._try(source, new_robot)
            except LostProcessError as error:
                raise EngineError(f"an isolated process was lost twice: {error}") from None
        why = "" if outcome.error is None else f" ({outcome.error.kind}: {outcome.error.message!a})"
        EVENTS.debug("program %08x: %s%s", name, outcome.status.value, why)
        return outcome

    def run_live(self, source: str, robot: SkillPerformer) -> Outcome:
        """Run a program on a robot, once and never again: what that has done cannot be undone.

        What the robot raises besides `RobotError` ends the run and is raised here.
        """
        try:
            prepared = self._preparer.prepare(source, lowercase=robot.rules.literals == "lowercase")
            return prepared if isinstance(prepared, Outcome) else self._fork(LIVE_SERVER, prepared, robot)
        except LostProcessError as error:
            self.close()
            stopped = "the engine was stopped" if self._stopped else f"an isolated process was lost: {error}"
            raise EngineError(stopped) from None

    def stop(self) -> None:
        """End all processes, from any thread, and with them a run that is still going on."""
        self._stopped = True
        self._preparer.kill()
        for fork_server in list(self._fork_servers.values()):
            fork_server.kill()

    def stay_on(self, core: int) -> None:
        """Let the processes run on one core only."""
        for fork_server in self._fork_servers.values():
            os.sched_setaffinity(fork_server.pid, {core})

    def close(self) -> None:
        """End all processes; nothing may be running."""
        self._preparer.close()
        while self._fork_servers:
            self._fork_servers.popitem()[1].close()

    def forget(self) -> None:
        """Close the descriptors in a forked process, whose children these are not."""
        self._preparer.forget()
        while self._fork_servers:
            self._fork_servers.popitem()[1].forget()

    def _try(self, source: str, new_robot: Callable[[], SkillPerformer]) -> Outcome:
        try:
            robot = new_robot()
            prepared = self._preparer.prepare(source, lowercase=robot.rules.literals == "lowercase")
            if isinstance(prepared, Outcome):
                return prepared
            if prepared.imports:
                return self._fork(LIBRARY_SERVER, prepared, robot)
            try:
                return self._fork(FORK_SERVER, prepared, robot)
            except ImportsMoreError as error:
                return self._fork(LIBRARY_SERVER, prepared, new_robot(), patience=error.patience)
        except (LostProcessError, OSError) as error:
            if self._stopped:
                raise EngineError("the engine was stopped") from None
            self.close()
            raise LostProcessError(str(error)) from None

    def _fork(
        self, role: str, prepared: Prepared, robot: SkillPerformer, *, patience: float | None = None
    ) -> Outcome:
        """Run a prepared program in a child of one of the fork servers."""
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
