"""The same programs without isolation: in this process, to be timed, or in an ordinary one, to be compared.

Run as a script, this is the ordinary process: it takes programs from its input and forks for each, so that
they cannot see one another, but closes no walls and calls the simulated robot as a function.
"""

from __future__ import annotations

import builtins
import os
import pickle
import re
import resource
import subprocess
import sys
import time
import types
from functools import lru_cache
from typing import Any, Self

from codebotler.simulator.robot import RobotError, SimulatedRobot
from codebotler.simulator.rules import PAPER, Rules
from codebotler.simulator.sandbox import execution
from codebotler.simulator.sandbox.execution import RECURSION_LIMIT, BudgetSpentError, Run
from codebotler.simulator.sandbox.surroundings import simulate_surroundings
from codebotler.simulator.sandbox.ticks import ENTER, ENTRY, TICK, prepared
from codebotler.trace import Option, Outcome, RunError, Status
from codebotler.world import World

CPU_SECONDS = 30
MEMORY = 2 * 1024**3
DEEPER = 500  # a robot that is called as a function takes more of the stack than one that is asked by socket
OPTION_OVERHEAD = 10  # characters that an option counts more than it has


class Bare(Run):
    """A program that runs in this process and calls the simulated robot as a function.

    Args:
        robot: who executes its skills.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        skills = [[s.name, [[p.name, p.type.__name__] for p in s.parameters]] for s in robot.skills.values()]
        self.limits = robot.rules.limits
        super().__init__({"skills": skills, "ticks": self.limits.ticks, "seconds": self.limits.seconds})
        self.robot, self.calls = robot, 0

    def request(self, message: list[Any]) -> Any:  # noqa: ANN401 - what a skill returns
        """Do what the engine would."""
        name, values = message
        self.calls += name != "sleep"
        self.spent = name == "sleep" or self.calls > self.limits.calls
        if self.spent:
            raise BudgetSpentError
        return self.robot.perform(name, arguments(values))


def arguments(values: list[Any]) -> list[Any]:
    """What a program gives to a skill, as the robot takes it."""
    return [
        tuple(Option(text, is_text) for text, is_text in value) if isinstance(value, list) else value
        for value in values
    ]


# --- to be timed


@lru_cache(maxsize=100_000)
def compiled(source: str) -> types.CodeType | BaseException:
    """A program's code, or why there is none."""
    try:
        return prepared(source, lowercase=True)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        return error


def run_bare(pair: tuple[str, World]) -> None:
    """Run a pair in this process."""
    source, world = pair
    code = compiled(source)
    if isinstance(code, BaseException):
        return
    run = Bare(SimulatedRobot(world))
    namespace = {"__name__": "__main__", **run.names()}
    tick = run.ticker()
    setattr(builtins, TICK, tick)
    setattr(builtins, ENTRY, tick)
    setattr(builtins, ENTER, run.enter)
    time.sleep = run.sleep
    try:
        exec(code, namespace)
        if not run.entered:
            exec("task_program()", namespace)
    except BaseException:  # noqa: BLE001 - however a program ends, its time was measured
        return


# --- to be compared


class Unwalled(Bare):
    """A program that runs in this process and is told and judged all that the engine tells and judges.

    Args:
        source: the program.
        robot: who executes its skills.
    """

    def __init__(self, source: str, robot: SimulatedRobot) -> None:
        super().__init__(robot)
        clock = robot.rules.clock_starts.timestamp()
        self.job |= {"source": source, "literals": robot.rules.literals, "clock": clock}
        self.text = 0
        self.limit: str | None = None
        self.errors: list[RobotError] = []

    def request(self, message: list[Any]) -> Any:  # noqa: ANN401 - what a skill returns
        """Do what the engine would, and find the limits that it would."""
        name, values = message
        if not self.spent:
            self.limit = self.reached(name, values)
        if self.spent or self.limit:
            self.spent = True
            raise BudgetSpentError
        self.robot.now = float(self.now)
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(RECURSION_LIMIT + DEEPER)
        try:
            return self.robot.perform(name, arguments(values))
        except RobotError as error:
            self.errors.append(error)
        finally:
            sys.setrecursionlimit(limit)
        last = self.errors[-1]
        failure = type(last.kind, (execution.RobotError,), {"__module__": "robot"})(str(last))
        failure.number = len(self.errors) - 1
        raise failure

    def reached(self, name: str, values: list[Any]) -> str | None:
        """The limit that a request goes beyond, in words."""
        if self.now > self.limits.seconds:
            self.robot.now = self.limits.seconds
            return f"{self.limits.seconds:,.0f} seconds of simulated time"
        options = [text for value in values if isinstance(value, list) for text, _ in value]
        texts = options + [value for value in values if isinstance(value, str)]
        self.calls += name in self.robot.skills
        self.text += sum(map(len, texts)) + OPTION_OVERHEAD * (len(texts) - len(values))
        if self.calls > self.limits.calls:
            return f"{self.limits.calls:,} skill calls"
        if any(len(text) > self.limits.text for text in texts):
            return f"a text of more than {self.limits.text:,} characters"
        if self.text > self.limits.trace:
            return f"texts of more than {self.limits.trace:,} characters in all"
        return None

    def outcome(self, final: dict[str, Any]) -> Outcome:
        """The outcome of a run that ended like this."""
        status = Status.TIMEOUT if self.limit else Status(final["end"])
        if status is Status.FINISHED:
            return Outcome(status, self.robot.trace)
        if status is Status.TIMEOUT:
            error = RunError("TimeoutError", self.limit or f"{self.limits.ticks:,} turns of loops")
        elif status is Status.ROBOT_ERROR:
            failure = self.errors[final["number"]]
            error = RunError(failure.kind, str(failure))
        else:
            kind = final["kind"] if final["kind"].isidentifier() else "Exception"
            error = RunError(kind, final["message"])
        return Outcome(status, self.robot.trace, error, final["line"])


class OrdinaryProcess:
    """A process without walls that runs programs; use as a context manager.

    Hashing is fixed as it is in the engine, so that sets have the same order. Addresses are not;
    compare outcomes `without_addresses`.

    Args:
        rules: how the worlds are simulated.
    """

    def __init__(self, rules: Rules = PAPER) -> None:
        self.rules = rules
        surroundings = {"PYTHONHASHSEED": "0", "TZ": "UTC", "LC_ALL": "C.UTF-8", "PYTHONUTF8": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-W", "ignore", __file__],
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
            EOFError: the program took the process down with it.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        pickle.dump((source, world, self.rules), self._process.stdin)
        self._process.stdin.flush()
        outcome = pickle.load(self._process.stdout)
        assert isinstance(outcome, Outcome)
        return outcome


def without_addresses(outcome: Outcome) -> str:
    """Everything in an outcome, with the places and times that its comparison leaves out, but no address."""
    return re.sub(r"0x[0-9a-fA-F]+", "0x", repr(outcome))


# The functions below call one another as those of the zygote do: how deep a program may call itself depends
# on how deep it stands.


def main() -> None:
    """Be the ordinary process, until there is nothing more to run."""
    serve()


def serve() -> None:
    """Run one program after the other."""
    while one_run():
        pass


def one_run() -> bool:
    """Fork for one program and wait for it; what it prints on the output is its outcome."""
    try:
        source, world, rules = pickle.load(sys.stdin.buffer)
    except EOFError:
        return False
    pid = os.fork()
    if pid == 0:
        try:
            child(Unwalled(source, SimulatedRobot(world, rules)))
        finally:
            os._exit(1)
    return os.waitpid(pid, 0)[1] == 0


def child(run: Unwalled) -> None:
    """Run the program and say how it ended."""
    resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS, CPU_SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    output = sys.stdout.buffer
    simulate_surroundings(run)
    outcome = run.outcome(run.execute())
    output.write(pickle.dumps(outcome))
    output.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
