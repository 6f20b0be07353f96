"""Runs programs one at a time, each compiled first, with fork servers."""

from __future__ import annotations

import logging
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TypeAlias

from codebotler.core.trace import Outcome
from codebotler.simulator.batches.replay import outcomes
from codebotler.simulator.ledger import SkillPerformer, judge_end
from codebotler.simulator.process.compiler import CompiledProgram, compile_program, compile_programs
from codebotler.simulator.process.errors import EngineError, LostProcessError, ProtocolError
from codebotler.simulator.process.fork_server_client import BatchServer, ForkServer
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.skill_protocol import SkillProtocol
from codebotler.simulator.worlds.robot import SimulatedRobot

__all__ = ["EngineError", "Worker"]

run_log = logging.getLogger("codebotler.engine.events")  # logs the start and end of each run, at DEBUG
NewRobot: TypeAlias = Callable[[], SimulatedRobot]
Job: TypeAlias = tuple[str, Sequence[NewRobot]]
"""A program, and one function per run that creates its robot."""


class Worker:
    """Owns the processes that run programs, one at a time.

    Nearly all programs are tame: they leave nothing behind, so many of them share a process that has copies
    of their robots. All other runs, and those that such a process cannot finish, get their own process.
    There, the engine performs the skills, and programs can import modules of the standard library.

    Args:
        one_process_per_run: whether each run gets its own process, even if its program is tame.
    """

    def __init__(self, *, one_process_per_run: bool = False) -> None:
        self._stopped = False
        self._child: IsolatedProcess | None = None  # the child that runs batches
        self._keeps_child = False
        self._one_process_per_run = one_process_per_run
        self._fork_servers: dict[type[ForkServer], ForkServer] = {}
        first = ForkServer if one_process_per_run else BatchServer
        try:
            self.has_seccomp = self._fork_server(first).has_seccomp
        except LostProcessError as error:
            raise EngineError(f"the engine cannot start: {error}") from None

    def run(self, source: str, new_robot: NewRobot) -> Outcome:
        """Run a program on a new robot. If a process is lost, repeat the run once with another new robot."""
        return self.run_all([(source, [new_robot])])[0][0]

    def run_all(self, jobs: Sequence[Job]) -> list[list[Outcome]]:
        """Run programs. Each outcome depends only on the program and its robot.

        Args:
            jobs: programs with functions that create their robots, all with the same skills and `literals`.

        Returns:
            each program's outcomes, one per robot. A repeated run gets a new robot.
        """
        known = self.run_tame(jobs)
        return [
            [
                known[number, run] if (number, run) in known else self.run_alone(source, new_robot)
                for run, new_robot in enumerate(robots)
            ]
            for number, (source, robots) in enumerate(jobs)
        ]

    def run_live(self, source: str, robot: SkillPerformer) -> Outcome:
        """Run a program on a live robot, without retries, since actions cannot be undone.

        Any error of the robot other than `RobotError` ends the run, and is raised here.
        """
        try:
            return self._fork(source, robot)
        except LostProcessError as error:
            self.close()
            stopped = "the engine was stopped" if self._stopped else f"an isolated process was lost: {error}"
            raise EngineError(stopped) from None

    def compiles(self, source: str, robot: SkillPerformer) -> bool:
        """Return whether a program compiles with the robot's skills and settings."""
        return isinstance(_compile(source, robot), CompiledProgram)

    def stop(self) -> None:
        """Kill all processes and the current run. Any thread may call this. Do not use the worker again."""
        self._stopped = True
        for fork_server in list(self._fork_servers.values()):
            fork_server.kill()

    def close(self) -> None:
        """End all processes. Call this only while nothing is running."""
        self._end_child()
        while self._fork_servers:
            self._fork_servers.popitem()[1].close()

    # --- several tame programs in one child

    def run_tame(self, jobs: Sequence[Job]) -> dict[tuple[int, int], Outcome]:
        """Run the programs that may share a process. Return all known outcomes by job and robot index."""
        known: dict[tuple[int, int], Outcome] = {}
        if self._one_process_per_run or not jobs:
            return known
        try:
            waiting = list(self._tame(jobs))
            while waiting:
                waiting = self._run_batch(waiting, jobs, known)
        except (LostProcessError, OSError):
            if self._stopped:
                raise EngineError("the engine was stopped") from None
            self.close()
        return known

    def _tame(self, jobs: Sequence[Job]) -> Iterator[tuple[int, bytes, list[SimulatedRobot]]]:
        robot = jobs[0][1][0]()
        if robot.guard is not None and robot.guard.may_refuse:
            return  # the child's copies of robots cannot refuse actions
        sources = [source for source, _ in jobs]
        found = compile_programs(sources, robot.settings.literals, tuple(robot.skills))
        for number, compiled in enumerate(found):
            if isinstance(compiled, CompiledProgram) and compiled.is_tame:
                yield number, compiled.code, [new_robot() for new_robot in jobs[number][1]]

    def _run_batch(
        self,
        batch: list[tuple[int, bytes, list[SimulatedRobot]]],
        jobs: Sequence[Job],
        known: dict[tuple[int, int], Outcome],
    ) -> list[tuple[int, bytes, list[SimulatedRobot]]]:
        """Run programs in one child, and return the programs that it did not begin before it failed."""
        child = self._child = self._child or self._fork_server(BatchServer).fork()
        for number, _, robots in batch:
            for _ in robots:
                _log(jobs[number][0], "started")
        ended = outcomes(child, [(code, robots) for _, code, robots in batch])
        waiting = list(batch)
        is_sound = False
        try:
            while waiting:
                number, _, robots = waiting.pop(0)
                for run in range(len(robots)):
                    outcome = next(ended)
                    if outcome is not None:
                        known[number, run] = outcome
                        _log_end(jobs[number][0], outcome)
            is_sound = True
        except (LostProcessError, ProtocolError, TimeoutError):
            pass
        finally:
            if not (is_sound and self._keeps_child):
                self._end_child()
        return waiting

    @contextmanager
    def one_child(self) -> Iterator[None]:
        """Use one process for all batches in this context, which must all run the same program."""
        self._keeps_child = True
        try:
            yield
        finally:
            self._keeps_child = False
            self._end_child()

    def _end_child(self) -> None:
        """Kill the last batch's child, and fork the next one in advance."""
        child, self._child = self._child, None
        if child is None:
            return
        server = self._fork_servers.get(BatchServer)
        if not isinstance(server, BatchServer) or server.has_ended:  # its child has ended with the server
            child.close_channel()
            return
        with suppress(LostProcessError):  # the server may end at any moment
            child.kill()
        child.close_channel()
        server.fork_ahead()

    # --- one child per run

    def run_alone(self, source: str, new_robot: NewRobot) -> Outcome:
        """Run a program in its own process. If the process is lost, repeat the run once with a new robot."""
        _log(source, "started")
        try:
            outcome = self._try(source, new_robot)
        except LostProcessError as first:
            _log(source, f"a process was lost, so the run is repeated: {first}")
            try:
                outcome = self._try(source, new_robot)
            except LostProcessError as error:
                raise EngineError(f"an isolated process failed, and so did the retry: {error}") from None
        _log_end(source, outcome)
        return outcome

    def run_on(self, source: str, robot: SimulatedRobot) -> Outcome:
        """Run a program on this robot, without retries. Raise EngineError if the process is lost."""
        robots = [robot]

        def only_robot() -> SimulatedRobot:
            if not robots:
                raise EngineError("an isolated process failed; run the command again")
            return robots.pop()

        return self.run_alone(source, only_robot)

    def _try(self, source: str, new_robot: NewRobot) -> Outcome:
        try:
            robot = new_robot()
            return judge_end(self._fork(source, robot), robot)
        except (LostProcessError, OSError) as error:
            if self._stopped:
                raise EngineError("the engine was stopped") from None
            self.close()
            raise LostProcessError(str(error)) from None

    def _fork(self, source: str, robot: SkillPerformer) -> Outcome:
        compiled = _compile(source, robot)
        if isinstance(compiled, Outcome):
            return compiled
        child = self._fork_server(ForkServer).fork(is_live=robot.is_live)
        return SkillProtocol(child, compiled.code, robot).outcome()

    def _fork_server(self, kind: type[ForkServer]) -> ForkServer:
        if kind not in self._fork_servers:
            self._fork_servers[kind] = kind()
            if self._stopped:
                self._fork_servers[kind].kill()
        return self._fork_servers[kind]


def _compile(source: str, robot: SkillPerformer) -> CompiledProgram | Outcome:
    return compile_program(source, robot.settings.literals, tuple(robot.skills))


def _log(source: str, what: str) -> None:
    if run_log.isEnabledFor(logging.DEBUG):
        run_log.debug("program %08x: %s", zlib.crc32(source.encode(errors="surrogatepass")), what)


def _log_end(source: str, outcome: Outcome) -> None:
    why = "" if outcome.error is None else f" ({outcome.error.kind}: {outcome.error.message!a})"
    _log(source, f"{outcome.status.value}{why}")
