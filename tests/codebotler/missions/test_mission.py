"""Missions go through their states, log every event, and end at once when they are stopped."""

from __future__ import annotations

import json
import os
import re
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.trace import Outcome
from codebotler.core.world import Room, World
from codebotler.missions import mission as module
from codebotler.missions.mission import UNCONFIRMED_STOP, Mission, MissionError
from codebotler.missions.storage.log import (
    EVENTS_FILE,
    NEXT_STATES,
    SUMMARY_FILE,
    LogLine,
    MissionState,
    MissionSummary,
    read_events,
)
from codebotler.missions.storage.store import find_mission, read_missions, recover_missions
from codebotler.robots.base import NotReadyError, Robot, RobotLostError, RobotResult
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from codebotler.simulator import ledger
from codebotler.simulator.pool import SHARED_POOL
from codebotler.simulator.process.compiler import compile_program
from codebotler.simulator.worker import Worker
from doubles import FakeRobot, fail_with, replay
from processes import are_gone, children_of

HELLO = "def task_program():\n    say('hello')\n    say('bye')\n"
WORLD = World((Room("hall"), Room("kitchen")), "hall")
STUBBORN = """
def task_program():
    while True:
        try:
            say("a")
        except BaseException:
            pass
        finally:
            go_to("kitchen")
"""


@pytest.fixture
def home(tmp_path: Path) -> Path:
    return tmp_path / "home"


def prepare(
    home: Path, program: str = HELLO, on_event: Callable[[LogLine], None] = lambda _: None
) -> Mission:
    """Make a mission and approve it."""
    mission = Mission(home, "answering", on_event=on_event)
    mission.set_program(program)
    mission.record_check([])
    mission.approve()
    return mission


def run_to_end(home: Path, robot: Robot, program: str = HELLO) -> Mission:
    """Run a mission to its end."""
    with Reservation(robot, home) as reserved, prepare(home, program) as mission:
        mission.run(reserved)
    return mission


def kinds(mission: Mission) -> list[str]:
    """List the kinds of a mission's events; a state counts by its name."""
    return [
        line["state"] if line["event"] == "state" else line["event"] for line in read_events(mission.folder)
    ]


# --- states


def test_mission_goes_through_its_states_and_writes_all_that_happens(home: Path) -> None:
    robot = FakeRobot()
    mission = run_to_end(home, robot)
    before = ["drafting", "drafting", "checked", "approved", "running"]
    said = ["skill", "feedback", "result"]
    assert kinds(mission) == [*before, *said, *said, "done"]
    assert (robot.done, robot.connections) == (["hello", "bye"], 0)
    (summary,) = read_missions(home)
    assert (summary.state, summary.program, summary.robot) == ("done", HELLO, "answering")
    assert summary.ended is not None
    assert summary.ended >= summary.created
    assert [event.text for event in mission.trace] == ["hello", "bye"]


def test_each_event_is_on_the_disk_before_a_listener_hears_it(home: Path) -> None:
    calls: list[int] = []

    def count(line: LogLine) -> None:
        assert read_events(home / "missions" / mission.id)[-1] == json.loads(json.dumps(line))
        calls.append(1)

    with Reservation(FakeRobot(), home) as reserved, prepare(home) as mission:
        mission.on_event = count
        mission.run(reserved)
    assert len(calls) == 8


STEP: dict[str, Callable[[Mission, Reservation], object]] = {
    "draft": lambda mission, _: mission.set_program(HELLO),
    "check": lambda mission, _: mission.record_check([]),
    "approve": lambda mission, _: mission.approve(),
    "fail": lambda mission, _: mission.fail("no"),
    "run": lambda mission, reserved: mission.run(reserved),
    "stop": lambda mission, _: mission.stop(),
}


@pytest.mark.parametrize(
    ("before", "refused"),
    [
        ([], ["check", "approve", "run"]),
        (["draft"], ["approve", "run"]),
        (["draft", "check"], ["run"]),
        (["draft", "check", "approve"], ["draft", "check", "approve"]),
        (["draft", "check", "draft"], ["approve", "run"]),
        (["draft", "check", "approve", "run"], list(STEP)),
        (["fail"], list(STEP)),
        (["stop"], list(STEP)),
    ],
)
def test_illegal_steps_are_refused_with_a_sentence(home: Path, before: list[str], refused: list[str]) -> None:
    with Reservation(FakeRobot(), home) as reserved, Mission(home, "answering") as mission:
        for step in before:
            STEP[step](mission, reserved)
        state, events = mission.state, read_events(mission.folder)
        for step in refused:
            with pytest.raises(MissionError) as error:
                STEP[step](mission, reserved)
            assert error.value.sentence.startswith(f"mission {mission.id} ")
        assert (mission.state, read_events(mission.folder)) == (state, events)


def test_running_mission_can_only_be_stopped(home: Path) -> None:
    with (
        Reservation(Simulated(WORLD), home) as reserved,
        prepare(home) as mission,
        run_in_thread(mission, reserved, until="skill"),
    ):
        for step in ("draft", "check", "approve", "fail", "run"):
            with pytest.raises(MissionError, match="is running"):
                STEP[step](mission, reserved)
        mission.stop()
    assert mission.state is MissionState.STOPPED


def test_program_with_problems_needs_explicit_approval(home: Path) -> None:
    with Mission(home, "answering") as mission:
        mission.set_program(HELLO)
        mission.record_check(["line 2: there is nobody"])
        with pytest.raises(MissionError, match="has problems"):
            mission.approve()
        mission.approve(despite_problems=True)
        assert mission.state is MissionState.APPROVED
    assert MissionSummary.read(mission.folder).problems == ("line 2: there is nobody",)


@pytest.mark.parametrize(
    ("error", "state", "reason"),
    [
        (None, "stopped", "stopped by .* before it ran"),
        (KeyboardInterrupt(), "stopped", "stopped by .* before it ran"),
        (ValueError("odd"), "failed", "odd"),
    ],
)
def test_leaving_the_context_ends_the_mission(
    home: Path, error: BaseException | None, state: str, reason: str
) -> None:
    mission = Mission(home, "answering")
    with suppress(KeyboardInterrupt, ValueError), mission:
        mission.set_program(HELLO)
        if error:
            raise error
    summary = MissionSummary.read(mission.folder)
    assert summary.state == state
    assert re.fullmatch(reason, summary.reason)


def test_every_state_but_final_ones_has_a_successor() -> None:
    ends = set(MissionState) - set(NEXT_STATES)
    assert ends == {MissionState.DONE, MissionState.FAILED, MissionState.STOPPED, MissionState.INTERRUPTED}
    assert all(NEXT_STATES.values())


# --- ends


@pytest.mark.parametrize(
    ("program", "answer", "reason", "line"),
    [
        ("def task_program(:\n", replay(), "SyntaxError", 1),
        ("def task_program():\n    say(helo)\n", replay(), "NameError", 2),
        (HELLO, fail_with(RobotError("SayMute", "it is mute")), "SayMute: it is mute", 2),
        (HELLO, fail_with(RobotLostError("its server died")), "the robot was lost: its server died", None),
        (HELLO, fail_with(ValueError("odd")), "ValueError: odd", None),
        (HELLO, replay("Hi"), "the robot was lost: .* say .*'Hi'", None),
        ("def task_program():\n    while True: pass\n", replay(), "TimeoutError", 2),
    ],
)
def test_mission_that_fails_says_why(
    home: Path, program: str, answer: Callable[[str, str], RobotResult], reason: str, line: int | None
) -> None:
    robot = FakeRobot(answer)
    mission = run_to_end(home, robot, program)
    summary = MissionSummary.read(mission.folder)
    assert (summary.state, summary.line) == ("failed", line)
    assert re.match(reason, summary.reason)
    assert len(robot.done) < 2
    assert robot.connections == 0


def test_robot_does_not_go_on_when_the_mission_fails_from_within(home: Path) -> None:
    robot = FakeRobot(fail_with(ValueError("odd")))
    run_to_end(home, robot)
    assert robot.cancels == 1


def test_program_can_catch_an_error_of_the_robot(home: Path) -> None:
    program = "def task_program():\n    try: go_to('moon')\n    except Exception as e: say(str(e))\n"
    robot = Simulated(WORLD, speed=None)
    mission = run_to_end(home, robot, program)
    assert mission.state is MissionState.DONE
    said, error = (event.text for event in mission.trace)
    assert said == "moon"
    assert '"moon"' in error


# --- stop


@contextmanager
def run_in_thread(mission: Mission, reserved: Reservation, until: str) -> Iterator[None]:
    """Run a mission on another thread; enter after an event, and wait for the end on leaving."""
    happened = threading.Event()
    thread = threading.Thread(target=mission.run, args=(reserved,))

    def hear(line: LogLine) -> None:
        if line["event"] == until:
            happened.set()

    mission.on_event = hear
    thread.start()
    assert happened.wait(30)
    yield
    thread.join(30)
    assert not thread.is_alive()


@pytest.mark.parametrize(
    ("program", "until"),
    [
        ("def task_program():\n    go_to('kitchen')\n    say('there')\n", "feedback"),
        pytest.param(
            "def task_program():\n    say('hello')\n    time.sleep(3600)\n    say('there')\n",
            "sleep",
            marks=pytest.mark.slow,
        ),
        (STUBBORN, "feedback"),
        pytest.param(
            "def task_program():\n    say('a')\n    sum(range(10**11))\n", "result", marks=pytest.mark.slow
        ),
    ],
)
def test_stop_ends_every_activity(home: Path, program: str, until: str) -> None:
    compile_program(program, "as-written", ())  # this process serves all missions, and stays
    before = children_of(os.getpid())
    with Reservation(Simulated(WORLD), home) as reserved, prepare(home, program) as mission:
        with run_in_thread(mission, reserved, until):
            began = time.monotonic()
            mission.stop("the test")
        assert time.monotonic() - began < 5
    happened = kinds(mission)
    assert happened[-1] == "stopped"
    assert "skill" not in happened[happened.index("stop") :]
    assert "by the test" in MissionSummary.read(mission.folder).reason
    assert are_gone(children_of(os.getpid()) - before)


def test_stop_cancels_the_robot_before_anything_else(home: Path) -> None:
    """A slow listener, like a blocked terminal, must not delay the robot's stop."""
    order: list[str] = []
    may_go_on, blocked = threading.Event(), threading.Event()

    class RecordingRobot(FakeRobot):
        def cancel(self) -> None:
            super().cancel()
            order.append("robot")

    def hear(line: LogLine) -> None:
        if line["event"] == "skill":
            blocked.set()
            assert may_go_on.wait(30)
        if line["event"] == "stop":
            order.append("written")

    robot = RecordingRobot()
    with Reservation(robot, home) as reserved, prepare(home) as mission, ThreadPoolExecutor(2) as threads:
        mission.on_event = hear
        running = threads.submit(mission.run, reserved)
        assert blocked.wait(30)
        stopping = threads.submit(mission.stop)
        while not order:
            time.sleep(0.001)
        assert not stopping.done()
        may_go_on.set()
        stopping.result(30)
        assert running.result(30) is MissionState.STOPPED
    assert order[0] == "robot"
    assert "written" in order
    assert robot.done == []


def test_stop_is_logged_even_if_the_mission_ends_before_cancel_returns(home: Path) -> None:
    asked, is_cancelled, has_ended = threading.Event(), threading.Event(), threading.Event()

    class Slow(FakeRobot):
        def cancel(self) -> None:
            super().cancel()
            if not is_cancelled.is_set():
                is_cancelled.set()
                assert has_ended.wait(30)

    def answer(_skill: str, _first: str) -> RobotResult:
        asked.set()
        assert is_cancelled.wait(30)
        return None

    def hear(line: LogLine) -> None:
        if line.get("state") == "stopped":
            has_ended.set()

    with (
        Reservation(Slow(answer), home) as reserved,
        prepare(home) as mission,
        ThreadPoolExecutor(1) as threads,
    ):
        mission.on_event = hear
        running = threads.submit(mission.run, reserved)
        assert asked.wait(30)
        mission.stop("the test")
        assert running.result(30) is MissionState.STOPPED
    assert kinds(mission)[-4:] == ["late", "stop", "stopping", "stopped"]
    (stop,) = [line for line in read_events(mission.folder) if line["event"] == "stop"]
    assert stop["by"] == "the test"
    assert 0 <= stop["seconds_to_cancel"] < 60


@pytest.mark.slow
@pytest.mark.parametrize("result", [None, RobotError("SayMute", "cancelled"), RobotLostError("gone")])
def test_robot_that_answers_after_a_stop_starts_nothing_more(home: Path, result: Exception | None) -> None:
    asked, may_answer = threading.Event(), threading.Event()

    def answer(_skill: str, _first: str) -> RobotResult:
        asked.set()
        assert may_answer.wait(30)
        if result:
            raise result
        return None

    robot = FakeRobot(answer)
    with (
        Reservation(robot, home) as reserved,
        prepare(home) as mission,
        run_in_thread(mission, reserved, "skill"),
    ):
        assert asked.wait(30)
        mission.stop()
        assert kinds(mission)[-1] == "stopping"
        may_answer.set()
    assert kinds(mission)[-1] == ("failed" if isinstance(result, RobotLostError) else "stopped")
    assert kinds(mission).count("skill") == 1


def test_unconfirmed_stop_fails_the_mission(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "STOP_GRACE_SECONDS", 0.3)
    asked, may_answer = threading.Event(), threading.Event()

    def never(_skill: str, _first: str) -> RobotResult:
        asked.set()
        may_answer.wait(60)
        return None

    robot = FakeRobot(never)
    with Reservation(robot, home) as reserved, prepare(home) as mission:
        with run_in_thread(mission, reserved, "skill"):
            assert asked.wait(30)
            mission.stop()
        summary = MissionSummary.read(mission.folder)
        assert (summary.state, summary.reason) == ("failed", UNCONFIRMED_STOP)
        assert mission.stuck is not None
    before = read_events(mission.folder)
    late_lines: list[LogLine] = []
    mission.on_event = late_lines.append
    may_answer.set()
    threads = [thread for thread in threading.enumerate() if thread.name == mission.id]
    for thread in threads:
        thread.join(30)
    assert threads
    assert mission.stuck in threads
    assert read_events(mission.folder) == before, "nothing is logged after the end"
    assert late_lines == [], "listeners hear nothing after the end"
    assert robot.done == ["hello"]


@pytest.mark.slow
def test_robot_whose_cancel_blocks_fails_the_mission(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "STOP_GRACE_SECONDS", 0.3)
    may_go_on = threading.Event()

    class Blocked(FakeRobot):
        def cancel(self) -> None:
            may_go_on.wait(60)

    def answer(_skill: str, _first: str) -> RobotResult:
        may_go_on.wait(60)
        return None

    with (
        Reservation(Blocked(answer), home) as reserved,
        prepare(home) as mission,
        ThreadPoolExecutor(1) as threads,
    ):
        with run_in_thread(mission, reserved, "skill"):
            stopping = threads.submit(mission.stop)
        assert (mission.summary.state, mission.summary.reason) == ("failed", UNCONFIRMED_STOP)
        may_go_on.set()
        assert isinstance(stopping.exception(30), MissionError)


@pytest.mark.slow
def test_endless_skill_runs_until_the_stop(home: Path) -> None:
    program = "def task_program(): go_to('kitchen')"
    with (
        Reservation(Simulated(WORLD, speed=1e-6), home) as reserved,
        prepare(home, program) as mission,
        run_in_thread(mission, reserved, until="skill"),
    ):
        mission.stop()
    assert kinds(mission)[-1] == "stopped"
    assert "cancelled" in kinds(mission)


def test_second_stop_cancels_again_and_keeps_the_first_reason(home: Path) -> None:
    asked = threading.Event()

    class Slow(FakeRobot):
        def cancel(self) -> None:
            super().cancel()
            if self.cancels > 1:
                asked.set()

    def answer(_skill: str, _first: str) -> RobotResult:
        assert asked.wait(30)
        return None

    robot = Slow(answer)
    with Reservation(robot, home) as reserved, prepare(home) as mission:
        with run_in_thread(mission, reserved, "skill"):
            mission.stop("one")
            mission.stop("two")
        assert mission.summary.reason == "stopped by one"
    assert robot.cancels >= 2


@pytest.mark.slow
def test_stop_is_logged_even_if_the_mission_ends_first(home: Path) -> None:
    class Quick(Simulated):
        def cancel(self) -> None:
            super().cancel()
            if threading.current_thread() is threading.main_thread():
                assert mission._is_over.wait(30)

    with Reservation(Quick(WORLD), home) as reserved, prepare(home, STUBBORN) as mission:
        with run_in_thread(mission, reserved, "feedback"):
            mission.stop("the test")
        assert kinds(mission)[-5:] == ["feedback", "cancelled", "stop", "stopping", "stopped"]


@pytest.mark.filterwarnings(
    "ignore::pytest.PytestUnhandledThreadExceptionWarning"
)  # The robot raises on its own thread.
def test_error_in_cancel_counts_as_an_unconfirmed_stop(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Breaks(FakeRobot):
        def cancel(self) -> None:
            raise TypeError("no such motor")

        def disconnect(self) -> None:
            may_answer.set()

    def never(_skill: str, _first: str) -> RobotResult:
        may_answer.wait(60)
        return None

    monkeypatch.setattr(module, "STOP_GRACE_SECONDS", 0.3)
    may_answer = threading.Event()
    with Reservation(Breaks(never), home) as reserved, prepare(home) as mission:
        with run_in_thread(mission, reserved, "skill"), pytest.raises(TypeError, match="no such motor"):
            mission.stop()
        assert mission.summary.reason == UNCONFIRMED_STOP


def test_stop_before_the_run_ends_the_mission(home: Path) -> None:
    with Reservation(FakeRobot(), home) as reserved, prepare(home) as mission:
        mission.stop("the test")
        with pytest.raises(MissionError, match="is stopped"):
            mission.run(reserved)
    assert "by the test before it ran" in mission.summary.reason


def test_stop_just_before_the_program_prevents_its_start(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []

    class Slow(Worker):
        def __init__(self, **options: bool) -> None:
            mission.stop("the test")
            super().__init__(**options)

        def run_live(self, source: str, robot: ledger.SkillPerformer) -> Outcome:
            begun.append(source)
            return super().run_live(source, robot)

    monkeypatch.setattr(module, "Worker", Slow)
    with Reservation(FakeRobot(), home) as reserved, prepare(home) as mission:
        assert mission.run(reserved) is MissionState.STOPPED
    assert begun == []
    assert "by the test" in mission.summary.reason


@pytest.mark.slow
def test_stop_at_any_moment_ends_as_stopped(home: Path) -> None:
    for number in range(8):
        with Reservation(FakeRobot(), home) as reserved, prepare(home, STUBBORN) as mission:
            threading.Timer(0.12 * number, mission.stop).start()
            state = MissionState.STOPPED
            while mission.state is MissionState.APPROVED:
                try:
                    state = mission.run(reserved)
                except MissionError:
                    break
            assert state is MissionState.STOPPED
        assert kinds(mission)[-1] == "stopped"


def test_interrupted_run_stops_the_robot(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Simulated(WORLD)

    class Interrupted(threading.Event):
        def wait(self, _timeout: float | None = None) -> bool:
            assert driving.wait(30)
            raise KeyboardInterrupt

    driving = threading.Event()
    with Reservation(robot, home) as reserved, prepare(home, STUBBORN) as mission:
        mission.on_event = lambda line: driving.set() if line["event"] == "feedback" else None
        monkeypatch.setattr(mission.stop_button, "ended", Interrupted())
        with pytest.raises(KeyboardInterrupt):
            mission.run(reserved)
        assert mission.state is MissionState.STOPPED


# --- the disk


def test_events_that_cannot_be_written_stop_the_robot(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = FakeRobot()
    with Reservation(robot, home) as reserved, prepare(home) as mission:
        real = os.write

        def full(file: int, data: bytes) -> int:
            if b'"result"' in data or b'"failed"' in data:
                raise OSError(28, "No space left on device")
            return real(file, data)

        monkeypatch.setattr("codebotler.core.files.os.write", full)
        with pytest.raises(OSError, match="No space left") as error:
            mission.run(reserved)
        assert error.value.filename == str(mission.folder / EVENTS_FILE)
        assert robot.done == ["hello"]
        assert robot.cancels
        monkeypatch.undo()
    (left,) = recover_missions(home)
    assert left.state == "interrupted"


def test_failing_listener_stops_the_robot(home: Path) -> None:
    def hear(line: LogLine) -> None:
        if line["event"] == "result":
            raise BrokenPipeError

    robot = FakeRobot()
    with Reservation(robot, home) as reserved, prepare(home) as mission:
        mission.on_event = hear
        mission.run(reserved)
    assert mission.state is MissionState.FAILED
    assert robot.done == ["hello"]


def test_missions_of_the_same_second_have_different_names(home: Path) -> None:
    with Mission(home, "a") as one, Mission(home, "b") as two, Mission(home, "c") as three:
        ids = [one.id, two.id, three.id]
    assert len(set(ids)) == 3
    assert [summary.id for summary in read_missions(home)] == ids
    assert find_mission(home, ids[1]) == two.folder
    assert find_mission(home, "last") == three.folder


LONG_NAME = f"20260101-000000-{'1' * 400}"


@pytest.mark.parametrize("name", ["", "..", "../..", "20260101-000000", LONG_NAME, "/", "last"])
def test_unknown_mission_is_refused(home: Path, name: str) -> None:
    (home / "missions").mkdir(parents=True)
    with pytest.raises(UserError, match=f'"{name}"' if name else "no mission"):
        find_mission(home, name)


def test_summary_is_written_whole_or_not_at_all(home: Path) -> None:
    with Mission(home, "a") as mission:
        before = (mission.folder / SUMMARY_FILE).read_text()
        (mission.folder / f"{SUMMARY_FILE}.new").mkdir()
        with pytest.raises(IsADirectoryError):
            mission.set_program(HELLO)
        assert (mission.folder / SUMMARY_FILE).read_text() == before
        (mission.folder / f"{SUMMARY_FILE}.new").rmdir()


# --- two at a time


def test_robot_is_on_one_mission_at_a_time(home: Path) -> None:
    with (
        Reservation(Simulated(WORLD), home) as reserved,
        prepare(home) as one,
        prepare(home) as two,
        run_in_thread(one, reserved, until="skill"),
    ):
        with pytest.raises(NotReadyError, match="already run a mission"):
            two.run(reserved)
        assert two.state is MissionState.APPROVED
        with pytest.raises(NotReadyError, match=f"process {os.getpid()}, since") as error:
            Reservation(Simulated(WORLD), home).__enter__()
        assert "another tool" in error.value.sentence
        one.stop()
    with Reservation(Simulated(WORLD), home):
        pass


def test_robots_at_other_addresses_do_not_exclude_each_other(home: Path) -> None:
    one, two = FakeRobot(), FakeRobot()
    one.address, two.address = "http://here:11311/", "http://there:11311/"
    with Reservation(one, home), Reservation(two, home):
        assert not (home / "robots").exists()


def test_robot_that_cannot_be_connected_is_not_reserved(home: Path) -> None:
    class Missing(FakeRobot):
        def connect(self) -> None:
            raise NotReadyError("no master")

    class Half(FakeRobot):
        def connect(self) -> None:
            super().connect()
            raise NotReadyError("no master")

    with pytest.raises(NotReadyError, match="no master"):
        Reservation(Missing(), home).__enter__()
    half = Half()
    with pytest.raises(NotReadyError, match="no master"):
        Reservation(half, home).__enter__()
    assert half.connections == 0, "its open connection is closed"
    with Reservation(FakeRobot(), home):
        pass


@pytest.fixture(autouse=True)
def join_threads() -> Iterator[None]:
    yield
    checking = () if SHARED_POOL.pool is None else SHARED_POOL.pool._threads._threads
    for thread in threading.enumerate():
        if (
            thread is not threading.main_thread()
            and not thread.name.startswith(("pytest", "starter"))
            and thread not in checking
        ):
            thread.join(10)
            assert not thread.is_alive(), thread
