"""Runs programs without isolation, in this process to time them or in an ordinary process to compare them."""

from __future__ import annotations

import json
import os
import pickle
import re
import resource
import subprocess
import sys
import time
import types
from functools import lru_cache
from pathlib import Path
from typing import IO, Any, Protocol, Self, TypeAlias

from codebotler.core.errors import RobotError
from codebotler.core.trace import Option, Outcome, RunError, Status
from codebotler.core.world import World
from codebotler.simulator.ledger import run_parameters
from codebotler.simulator.process.compiler import CompiledProgram, compile_here, result_of
from codebotler.simulator.sandbox import execution
from codebotler.simulator.sandbox.execution import PROGRAM_RECURSION_LIMIT, LimitReachedError, ProgramRun
from codebotler.simulator.sandbox.fuel import prepared
from codebotler.simulator.settings import PAPER_SETTINGS, SimulationSettings
from codebotler.simulator.skill_protocol import describe_skills
from codebotler.simulator.worlds.robot import Argument, SimulatedRobot

CPU_SECONDS = 30
MEMORY = 2 * 1024**3
DEEPER = 500  # extra stack for a robot that is called as a function instead of through a socket
OPTION_OVERHEAD = 10  # characters that count for an option in addition to its text
Execution: TypeAlias = tuple[bytes, tuple[int, float, float, float, bool]]
ORDINARY = Path(__file__).with_name("ordinary_process.py")


class Bare(ProgramRun):
    """A program that runs in this process and calls the simulated robot as a function.

    Args:
        robot: the robot that executes its skills.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__()
        self.robot, self.limits = robot, robot.settings.limits
        self.provide(describe_skills(robot))
        self.fuel, self.seconds, self.left = self.limits.ticks, self.limits.seconds, self.limits.calls

    def carry_out(self, name: str, arguments: list[Any]) -> Any:  # noqa: ANN401 - as in ProgramRun
        """Execute a skill call as the engine would."""
        self.left -= 1
        if self.left < 0:
            self.request(name)
        return self.robot.perform(name, for_robot(arguments))

    def request(self, request: str) -> Any:  # noqa: ANN401, ARG002 - as in ProgramRun
        """End the run, because a limit is reached."""
        self.has_reached_limit = True
        raise LimitReachedError


def for_robot(arguments: list[Any]) -> list[Argument]:
    """Convert a program's arguments for a skill to arguments for the robot."""
    return [
        tuple(Option(str(o), isinstance(o, str)) for o in value) if isinstance(value, list) else value
        for value in arguments
    ]


# --- programs to time


@lru_cache(maxsize=100_000)
def compile_program(source: str) -> types.CodeType | BaseException:
    """Compile a program. Return its code, or the error if it does not compile."""
    try:
        return prepared(source, lowercase=True)[0]
    except (SyntaxError, ValueError, MemoryError) as error:
        return error


class Reused(Bare):
    """Runs programs one after another. As in the fork server, everything possible is prepared only once.

    Args:
        world: any world.
    """

    def __init__(self, world: World) -> None:
        super().__init__(SimulatedRobot(world))
        time.sleep = self.sleep
        self.provided = dict(vars(self.namespace))

    def run(self, pair: tuple[str, World], settings: SimulationSettings = PAPER_SETTINGS) -> None:
        """Run a program in a world."""
        source, world = pair
        code = compile_program(source)
        if isinstance(code, BaseException):
            return
        self.robot, self.now = SimulatedRobot(world, settings), 0.0
        self.has_reached_limit = self.entered = False
        self.codes.clear()
        self.left = self.limits.calls
        self.refuel()
        namespace = self.provided.copy()
        try:
            exec(code, namespace)
            if not self.has_entered(namespace.get("task_program")):
                exec("task_program()", namespace)
        except BaseException:  # noqa: BLE001 - its time counts, not its end
            return


# --- programs to compare


class Unwalled(Bare):
    """A program that runs in this process with the same answers and limits as in the engine.

    Args:
        robot: the robot that executes its skills.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__(robot)
        self.text = self.asked = 0
        self.limit: str | None = None
        self.errors: list[RobotError] = []

    def carry_out(self, name: str, arguments: list[Any]) -> Any:  # noqa: ANN401 - as in ProgramRun
        """Execute a skill call as the engine would, within the same limits."""
        given = for_robot(arguments)
        self.limit = self.limit or self.exceeded_limit(given)
        if self.limit:
            super().request(name)
        self.robot.now = float(self.now)
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(PROGRAM_RECURSION_LIMIT + DEEPER)
        try:
            return self.robot.perform(name, given)
        except RobotError as error:
            error.__context__ = None  # a traceback, also that of its context, would keep frames alive
            self.errors.append(error.with_traceback(None))
        finally:
            sys.setrecursionlimit(limit)
        last = self.errors[-1]
        raise execution.robot_error(len(self.errors) - 1, last.kind, str(last))

    def request(self, request: str) -> Any:  # noqa: ANN401 - as in ProgramRun
        """End the run, because its time is over or it waits forever."""
        self.limit = self.limit or self.too_late() or "a wait for something that can never happen"
        return super().request(request)

    def too_late(self) -> str | None:
        """Return the time limit in words if it is reached, or None."""
        if self.now <= self.limits.seconds:
            return None
        self.robot.now = self.limits.seconds
        return f"{self.limits.seconds:,.0f} seconds of simulated time"

    def exceeded_limit(self, arguments: list[Argument]) -> str | None:
        """Return the limit that a skill call exceeds, in words, or None."""
        given = [each for one in arguments for each in (one if isinstance(one, tuple) else (one,))]
        texts = [each.text if isinstance(each, Option) else str(each) for each in given]
        if late := self.too_late():
            return late
        self.asked += 1
        self.text += sum(map(len, texts)) + OPTION_OVERHEAD * (len(texts) - len(arguments))
        if self.asked > self.limits.calls:
            return f"{self.limits.calls:,} skill calls"
        if any(len(text) > self.limits.text for text in texts):
            return f"a text of more than {self.limits.text:,} characters"
        if self.text > self.limits.trace:
            return f"texts of more than {self.limits.trace:,} characters in total"
        return None

    def prepare(self, source: str) -> Outcome | Execution:
        """Return what to execute, or an outcome if the source is not a valid program."""
        try:
            row = compile_here(source, self.robot.settings.literals, frozenset(self.robot.skills))
        except MemoryError as error:
            return Outcome(Status.PYTHON_ERROR, (), RunError("MemoryError", str(error)))
        found = result_of(*row)
        return self.execution(found.code) if isinstance(found, CompiledProgram) else found

    def execution(self, code: bytes) -> Execution:
        """Return what to execute of a program that parses."""
        return code, run_parameters(self.robot)

    def outcome_from(self, final: dict[str, Any]) -> Outcome:
        """Return the outcome of a run, given the data about its end."""
        status = Status.TIMEOUT if self.limit else Status(final["end"])
        if status is Status.FINISHED:
            return Outcome(status, self.robot.trace)
        if status is Status.TIMEOUT:
            error = RunError(
                "TimeoutError", self.limit or f"{self.limits.ticks:,} loop iterations and function calls"
            )
        elif status is Status.ROBOT_ERROR:
            failure = self.errors[final["number"]]
            error = RunError(failure.kind, str(failure))
        else:
            kind = final["kind"] if final["kind"].isidentifier() else "Exception"
            error = RunError(kind, final["message"])
        return Outcome(status, self.robot.trace, error, final.get("line"))


class OrdinaryProcess:
    """A context manager for a process that runs programs without a sandbox.

    Hashing is fixed as in the engine, so that sets have the same order. Addresses in memory vary, so compare
    outcomes `without_addresses`.

    Args:
        settings: the simulation settings.
    """

    def __init__(self, settings: SimulationSettings = PAPER_SETTINGS) -> None:
        self.settings = settings
        surroundings = {"PYTHONHASHSEED": "0", "TZ": "UTC", "LC_ALL": "C.UTF-8", "PYTHONUTF8": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", str(ORDINARY)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **surroundings},
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def outcome(self, source: str, world: World) -> Outcome:
        """Run one program in one world.

        Raises:
            EOFError: the program killed the process.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        pickle.dump((source, world, self.settings), self._process.stdin)
        self._process.stdin.flush()
        outcome = pickle.load(self._process.stdout)
        assert isinstance(outcome, Outcome)
        return outcome


def all_of(outcome: Outcome) -> str:
    """Format everything in an outcome, including the places and times that `==` ignores."""
    return f"{outcome!r} {outcome.trace!r}"


def without_addresses(outcome: Outcome) -> str:
    """Format everything in an outcome except addresses in memory."""
    return re.sub(r"0x[0-9a-fA-F]+", "0x", all_of(outcome))


class StandIn(Protocol):
    """Holds the current run for clocks and locks, which are created before the run."""

    run: ProgramRun


# The functions below call one another as those of the fork server do, because the depth to which a program
# may call itself depends on the depth at which it starts.


def serve(stand_in: StandIn, input_: IO[bytes], output: IO[bytes]) -> None:
    """Run programs one after another until the input ends."""
    while one_run(stand_in, input_, output):
        pass


def one_run(stand_in: StandIn, input_: IO[bytes], output: IO[bytes]) -> bool:
    """Fork a child for one program and wait for it. The child writes the outcome to the output."""
    try:
        source, world, settings = pickle.load(input_)
    except EOFError:
        return False
    pid = os.fork()
    if pid == 0:
        try:
            child(stand_in, source, SimulatedRobot(world, settings), output)
        finally:
            os._exit(1)
    return os.waitpid(pid, 0)[1] == 0


def child(stand_in: StandIn, source: str, robot: SimulatedRobot, output: IO[bytes]) -> None:
    """Run the program, and write its outcome to the output."""
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS, CPU_SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    sys.setrecursionlimit(PROGRAM_RECURSION_LIMIT)
    run = stand_in.run = Unwalled(robot)
    what = run.prepare(source)
    outcome = what if isinstance(what, Outcome) else run.outcome_from(json.loads(run.execute(*what)))
    output.write(pickle.dumps(outcome))
    output.flush()
    os._exit(0)
