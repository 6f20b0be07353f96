"""Runs on a live robot: real time, no action twice, and a stop of the robot ends the run."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Event, Outcome, Status, Trace
from codebotler.simulator.process.fork_server_client import ForkServer
from codebotler.simulator.sandbox import PROGRAM
from codebotler.simulator.settings import LIVE_LIMITS, PAPER_SETTINGS
from codebotler.simulator.worker import EngineError, Worker
from codebotler.simulator.worlds.robot import Argument, Result
from processes import are_gone, children_of, engine_processes, fork_servers

LIVE = replace(PAPER_SETTINGS, literals="as-written", limits=LIVE_LIMITS)


class LiveRobot:
    """A robot that moves its clock by two seconds per skill, without a real wait."""

    def __init__(self, does: Callable[[str], Result] = lambda _: None) -> None:
        self.settings, self.skills = LIVE, SKILLS
        self.is_live, self.now = True, 0.0
        self.done: list[str] = []
        self.does = does
        self.line: int | None = None
        self.lines: list[int | None] = []

    @property
    def trace(self) -> Trace:
        return tuple(Event("say", text) for text in self.done)

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        self.now += 2.0
        self.lines.append(self.line)
        text = str(arguments[0]) if arguments else skill
        result = self.does(text)
        self.done.append(text)
        return result

    def sleep_until(self, now: float) -> None:
        self.done.append(f"sleeps {now - self.now:g} s")
        self.now = now


@pytest.fixture
def others() -> set[int]:
    """Return the processes of engines that other tests keep open."""
    return engine_processes()


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    worker = Worker(one_process_per_run=True)
    yield worker
    worker.close()


@pytest.fixture
def own_worker(others: set[int]) -> Iterator[Worker]:  # noqa: ARG001 - counted before the worker starts
    """Yield a worker whose processes the test may end."""
    worker = Worker(one_process_per_run=True)
    yield worker
    worker.close()


def run_live(worker: Worker, program: str) -> tuple[list[str], Outcome]:
    machine = LiveRobot()
    outcome = worker.run_live(program, machine)
    return machine.done, outcome


def test_robot_keeps_the_clock_and_sleeps(worker: Worker) -> None:
    program = (
        "def task_program():\n"
        "    say('Hello')\n"
        "    say(str(time.monotonic()))\n"
        "    time.sleep(30)\n"
        "    say(time.strftime('%H:%M:%S'))\n"
    )
    happened, outcome = run_live(worker, program)
    assert happened == ["Hello", "2.0", "sleeps 30 s", "12:00:34"]
    assert outcome == Outcome(Status.FINISHED, tuple(Event("say", text) for text in happened))


def test_robot_knows_the_current_line_of_a_live_program(worker: Worker) -> None:
    program = """def greet(name):
    say("hello " + name)

def task_program():
    for room in ["a", "b"]:
        greet(room)
        [go_to(room) for room in [room]]
    sorted([2, 1], key=lambda n: say(str(n)) or n)
    exec("say('exec')")
"""
    machine = LiveRobot()
    assert worker.run_live(program, machine).status is Status.FINISHED
    assert machine.lines == [2, 7, 2, 7, 8, 8, 9]
    lies = f"""def task_program():
    exec(compile("\\n" * 1_000_000 + "say('far')", {PROGRAM!r}, "exec"))
"""
    machine = LiveRobot()
    worker.run_live(lies, machine)
    assert machine.lines == [None]


def test_limit_of_turns_restarts_after_each_skill_and_sleep(worker: Worker) -> None:
    turns = "    for _ in range(150_000): pass\n"
    both = f"def task_program():\n{turns}    say('a')\n{turns}    time.sleep(1)\n{turns}"
    assert run_live(worker, both)[1].status == Status.FINISHED
    happened, outcome = run_live(worker, f"def task_program():\n    say('a')\n{turns}{turns}")
    assert (happened, outcome.status) == (["a"], Status.TIMEOUT)


@pytest.mark.slow
def test_long_live_runs_have_no_limit_of_time(worker: Worker) -> None:
    program = "def task_program():\n    for i in range(1500): say(str(i)); time.sleep(60)\n"
    happened, outcome = run_live(worker, program)
    assert outcome.status == Status.FINISHED
    assert len(happened) == 3000


@pytest.mark.slow
def test_program_may_compute_for_long_between_skills(worker: Worker, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codebotler.simulator.process.isolated_process.PROCESS_WAIT_SECONDS", 1.0)
    program = (
        "def task_program():\n"
        "    for i in range(20):\n"
        "        for _ in range(7): sum(range(1_200_000))\n"
        "        say(str(i))\n"
    )
    assert run_live(worker, program)[0] == [str(number) for number in range(20)]


def test_program_that_never_stops_calling_ends(worker: Worker) -> None:
    machine = LiveRobot()
    machine.settings = replace(LIVE, limits=replace(LIVE_LIMITS, calls=5))
    outcome = worker.run_live("def task_program():\n    while True: say('a')\n", machine)
    assert (outcome.status, machine.done) == (Status.TIMEOUT, ["a"] * 5)
    assert LIVE_LIMITS.calls <= 100_000  # every call is kept in memory and logged


@pytest.mark.slow
@pytest.mark.parametrize("seconds", ["-1.0", "NaN", "Infinity", "true", '"1"', "[]"])
def test_forged_request_to_sleep_ends_the_run(worker: Worker, seconds: str) -> None:
    frame = f'["sleep",[{seconds}],0.0]'.encode()
    program = (
        "import os\n"
        f"def task_program():\n    os.write(3, len({frame!r}).to_bytes(4, 'big') + {frame!r})\n"
        "    say('a')\n"
    )
    machine = LiveRobot()
    assert worker.run_live(program, machine).status == Status.KILLED
    assert machine.done == []


@pytest.mark.slow
def test_program_that_imports_runs_only_once(worker: Worker) -> None:
    happened, outcome = run_live(
        worker, "def task_program():\n    say('a')\n    exec('import random')\n    say('b')\n"
    )
    assert (happened, outcome.status) == (["a", "b"], Status.FINISHED)


def test_errors_of_the_robot_reach_the_program_unchanged(worker: Worker) -> None:
    def does(_: str) -> Result:
        raise RobotError("GoToInvalidLocation", "the door is shut")

    program = "def task_program():\n    go_to('Hall')\n"
    outcome = worker.run_live(program, LiveRobot(does))
    assert outcome.error is not None
    assert (outcome.error.kind, outcome.error.message, outcome.line) == (
        "GoToInvalidLocation",
        "the door is shut",
        2,
    )


class StoppedError(Exception):
    """A person stopped the robot."""


def test_other_exceptions_of_the_robot_end_the_child_and_are_raised(worker: Worker) -> None:
    def does(text: str) -> Result:
        if text == "b":
            raise StoppedError
        return None

    stubborn = (
        "def task_program():\n"
        "    while True:\n"
        "        for text in 'abc':\n"
        "            try: say(text)\n"
        "            except BaseException: pass\n"
    )
    machine = LiveRobot(does)
    with pytest.raises(StoppedError):
        worker.run_live(stubborn, machine)
    assert machine.done == ["a"]
    assert are_gone(children_of(worker._fork_servers[ForkServer]._process.pid))
    assert run_live(worker, "def task_program(): say('next')")[0] == ["next"]


@pytest.mark.slow
def test_live_run_whose_process_is_lost_is_not_repeated(own_worker: Worker, others: set[int]) -> None:
    def does(_: str) -> Result:
        family = engine_processes() - others
        for pid in set(fork_servers()) - others:
            os.kill(pid, signal.SIGKILL)
        assert are_gone(family)
        return None

    machine = LiveRobot(does)
    with pytest.raises(EngineError, match="lost"):
        own_worker.run_live("def task_program():\n    say('a')\n    say('b')\n", machine)
    assert machine.done == ["a"]
    assert run_live(own_worker, "def task_program(): say('next')")[0] == ["next"]


def test_stop_ends_a_sleeping_run(own_worker: Worker, others: set[int]) -> None:
    sleeps, may_go_on = threading.Event(), threading.Event()

    class SleepingRobot(LiveRobot):
        def sleep_until(self, now: float) -> None:
            sleeps.set()
            assert may_go_on.wait(30)
            super().sleep_until(now)

    machine = SleepingRobot()
    with ThreadPoolExecutor(1) as thread:
        program = "def task_program():\n    time.sleep(3600)\n    say('a')\n"
        running = thread.submit(own_worker.run_live, program, machine)
        assert sleeps.wait(30)
        family = engine_processes() - others
        assert family
        own_worker.stop()
        assert are_gone(family)
        may_go_on.set()
        assert isinstance(running.exception(30), EngineError)
    assert machine.done == ["sleeps 3600 s"]


def test_unparsable_program_has_the_same_error_as_in_simulation(worker: Worker) -> None:
    happened, outcome = run_live(worker, "def task_program(:\n")
    assert (happened, outcome.status, outcome.error and outcome.error.kind) == (
        [],
        Status.PYTHON_ERROR,
        "SyntaxError",
    )
