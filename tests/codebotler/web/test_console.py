"""The console keeps the command line's rules for any number of viewers, and waits for none."""

from __future__ import annotations

import asyncio
import errno
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from codebotler.checking.check import check
from codebotler.checking.problems import CheckResult
from codebotler.core.errors import UserError
from codebotler.core.files import Appender
from codebotler.core.world import Room, World
from codebotler.core.world_file import read_world
from codebotler.missions.display.view import MissionOrder, SessionView, program_digest
from codebotler.missions.mission import Mission, MissionError
from codebotler.missions.preflight import known_instructions
from codebotler.missions.session import MissionSession
from codebotler.missions.storage import log as mission_log
from codebotler.missions.storage.log import LogLine, MissionState, MissionSummary
from codebotler.missions.storage.store import read_missions
from codebotler.models.base import Model, ModelError, Reply, TextListener, Usage, ignore_text
from codebotler.models.open import open_model
from codebotler.models.recorded import open_recorded
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt
from codebotler.robots.base import CancelledError, NotReadyError, Robot, RobotLostError, RobotResult
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import OFFICE, Simulated
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.web.console import MAX_PROGRAM_CHARACTERS, Console
from codebotler.web.hold_file import HOLD_POLL_SECONDS
from codebotler.web.notifier import Notifier
from codebotler.web.panes.instruction import examples
from doubles import FakeRobot
from server import Server

HELLO = "def task_program():\n    go_to('kitchen')\n    say('hello')\n"
BAD = "def task_program():\n    go_to('cellar')\n"
FAR = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('hall')\n"
WORLD = World((Room("hall"), Room("kitchen")), "hall")


class Author:
    """A model that writes the programs of a test in two pieces, and may wait in between.

    A string that defines no function is a reply without a program.
    """

    name = "author"
    settings = SamplingSettings()

    def __init__(self, *programs: str, waits: bool = False) -> None:
        self.programs, self.waits = list(programs), waits
        self.asked: list[Prompt] = []
        self.is_closed = False

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:  # noqa: ARG002 - models take it
        self.asked.append(prompt)
        if not self.programs:
            raise ModelError("the model is not there", is_temporary=False)
        program = self.programs.pop(0)
        on_text(program[:10])
        if self.waits:
            await asyncio.sleep(60)
        on_text(program[10:])
        return Reply(
            program, program, Usage(), 0.0, "stop", no_program=None if "def" in program else "no-code"
        )

    async def close(self) -> None:
        self.is_closed = True


def make_console(home: Path, robot: Robot | None = None, author: Author | None = None) -> Console:
    def model(_name: str) -> Model:
        assert author is not None
        return author

    return Console(robot or Simulated(WORLD, speed=None), home, model, models=("author",), world=WORLD)


@pytest.fixture
def console(tmp_path: Path) -> Iterator[Console]:
    with make_console(tmp_path) as console:
        yield console


def wait_until(console: Console, holds: Callable[[SessionView], bool], seconds: float = 60.0) -> SessionView:
    """Wait for a view of which something holds."""
    ends = time.monotonic() + seconds
    while not holds(console.view):
        assert time.monotonic() < ends, console.view
        time.sleep(0.005)
    return console.view


def begin_and_check(console: Console, program: str = HELLO) -> SessionView:
    console.begin(MissionOrder(program=program))
    return wait_until(console, lambda view: view.check is not None)


def begin_and_approve(console: Console, program: str = HELLO) -> None:
    view = begin_and_check(console, program)
    session = console.session
    assert session is not None
    session.approve(view.digest)


def test_an_instruction_becomes_a_mission_that_is_done(tmp_path: Path) -> None:
    author = Author(HELLO)
    with make_console(tmp_path, author=author) as console:
        session = console.begin(MissionOrder("say hello in the kitchen", "author"))
        view = wait_until(console, lambda view: view.may_be_approved)
        assert (view.program, view.problems, view.state) == (HELLO, (), MissionState.CHECKED)
        assert "kitchen" in author.asked[0].messages[-1].text
        assert author.is_closed
        session.approve(view.digest)
        view = wait_until(console, lambda view: view.is_over)
        assert view.state is MissionState.DONE
        assert [m.text for m in view.progress.moments if m.kind == "say"] == ["hello"]
        assert [line["event"] for line in session.events()][-1] == "state"
    (summary,) = read_missions(tmp_path)
    assert (summary.state, summary.model, summary.instruction) == (
        "done",
        "author",
        "say hello in the kitchen",
    )


@pytest.mark.slow
def test_every_example_runs_to_its_end_in_the_example_office(tmp_path: Path) -> None:
    world, model = read_world(OFFICE), open_recorded("recorded")
    robot = Simulated(world, speed=None)
    with Console(robot, tmp_path, lambda _: model, models=("recorded",), world=world) as console:
        assert len(examples(console)) >= 3
        for instruction in known_instructions(RoomMap.of(world)):
            console.begin(MissionOrder(instruction))
            view = wait_until(console, lambda view: view.check is not None)
            assert console.session is not None
            console.session.approve(view.digest, despite_problems=True)
            ended = wait_until(console, lambda view: view.is_over)
            assert (ended.state, ended.reason) == (MissionState.DONE, ""), instruction


def test_suggested_instructions_have_their_rooms_here(tmp_path: Path) -> None:
    office, model = read_world(OFFICE), open_recorded("recorded")
    for world, count in ((office, 3), (WORLD, 0)):
        robot = Simulated(world, speed=None)
        with Console(robot, tmp_path, lambda _: model, models=("recorded",), world=world) as console:
            console.begin(MissionOrder("Go to the lobby, and tell me how many people are there."))
            view = wait_until(console, lambda view: view.is_over)
            known = view.suggestions
            assert known is not None
            assert view.reason == view.error == "recorded:careful has no program for this instruction"
            assert len(known) == count
            assert set(known) <= set(known_instructions(RoomMap.of(world)))


def test_a_program_is_seen_while_it_is_written_and_a_stop_ends_the_writing(tmp_path: Path) -> None:
    author = Author(HELLO, waits=True)
    with make_console(tmp_path, author=author) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        view = wait_until(console, lambda view: bool(view.reply))
        assert (view.arriving.code, view.is_written, view.may_be_edited) == (HELLO[:10], True, False)
        console.stop("a test")
        session.join(5)
        assert console.view.is_over
        assert (console.view.state, author.is_closed) == (MissionState.STOPPED, True)


PROSE = "I cannot do that."


def test_a_reply_without_a_program_waits_for_a_person_who_asks_again(tmp_path: Path) -> None:
    author = Author(PROSE, PROSE, HELLO)
    with make_console(tmp_path, author=author) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        for repair in (False, True):
            view = wait_until(console, lambda view: view.waits_for_program)
            assert view.programless is not None
            assert (view.programless.text, view.phase, view.problems) == (PROSE, "no-program", ())
            assert (view.may_be_approved, view.may_be_edited, view.may_be_asked_again) == (False, True, True)
            with pytest.raises(MissionError):
                session.approve(view.digest)
            session.ask_again(repair=repair)
        view = wait_until(console, lambda view: view.may_be_approved)
        assert (view.program, view.programless, view.author) == (HELLO, None, "author")
        first, again, repaired = (prompt.messages[-1].text for prompt in author.asked)
        assert first == again != repaired
        assert [line["text"] for line in session.events() if line["event"] == "log"] == [
            "The reply holds no code."
        ] * 2


def test_a_program_is_kept_if_the_next_reply_has_none(tmp_path: Path) -> None:
    with make_console(tmp_path, author=Author(HELLO, PROSE)) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        before = wait_until(console, lambda view: view.may_be_approved)
        session.ask_again(repair=False)
        view = wait_until(console, lambda view: view.may_be_approved and view.programless is not None)
        assert (view.program, view.check) == (before.program, before.check)
        session.approve(view.digest)
        assert wait_until(console, lambda view: view.is_over).state is MissionState.DONE


def test_a_program_can_be_typed_if_the_model_wrote_none(tmp_path: Path) -> None:
    with make_console(tmp_path, author=Author(PROSE)) as console:
        console.begin(MissionOrder("say hello", "author"))
        wait_until(console, lambda view: view.waits_for_program)
        console.edit(HELLO)
        view = wait_until(console, lambda view: view.may_be_approved)
        assert (view.program, view.author, view.programless) == (HELLO, "", None)


def test_a_mission_without_a_program_can_be_stopped(tmp_path: Path) -> None:
    with make_console(tmp_path, author=Author(PROSE)) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        wait_until(console, lambda view: view.waits_for_program)
        console.stop("a test")
        session.join(5)
        assert (console.view.is_over, console.view.state) == (True, MissionState.STOPPED)


@pytest.mark.slow
def test_a_higher_limit_counts_from_then_on(tmp_path: Path) -> None:
    program = f"```python\n{HELLO}```"

    def model(name: str) -> Model:
        return open_model(name, SamplingSettings(base_url=server.url, max_tokens=8, temperature=0.5))

    robot = Simulated(WORLD, speed=None)
    with (
        Server(answer=lambda _: program, limits=True) as server,
        Console(robot, tmp_path, model, models=("openai-chat:m",), world=WORLD) as console,
    ):
        session = console.begin(MissionOrder("say hello"))
        view = wait_until(console, lambda view: view.waits_for_program)
        assert view.programless is not None
        assert (view.programless.kind, view.programless.higher_limit) == ("cut-off", 32)
        session.ask_again(repair=False, max_tokens=view.programless.higher_limit)
        assert wait_until(console, lambda view: view.may_be_approved).program == HELLO
        session.ask_again(repair=False)
        wait_until(console, lambda view: view.may_be_approved)
        bodies = [request.body for request in server.requests]
        assert [body["max_tokens"] for body in bodies] == [8, 32, 32]
        assert [body["temperature"] for body in bodies] == [0.5] * 3


def test_a_blank_program_is_ignored_if_there_is_an_instruction(tmp_path: Path) -> None:
    with make_console(tmp_path, author=Author(HELLO)) as console:
        console.begin(MissionOrder("say hello", program=" \n"))
        assert wait_until(console, lambda view: view.may_be_approved).program == HELLO


def test_an_emptied_program_has_a_problem_and_can_be_filled_again(console: Console) -> None:
    begin_and_check(console)
    console.edit("")
    view = wait_until(console, lambda view: view.check is not None and not view.program)
    assert (view.state, len(view.problems)) == (MissionState.CHECKED, 1)
    console.edit(HELLO)
    assert wait_until(console, lambda view: view.may_be_approved and bool(view.program)).problems == ()


def test_without_an_instruction_no_model_is_asked_again(tmp_path: Path) -> None:
    with make_console(tmp_path, author=Author(HELLO)) as console:
        session = console.begin(MissionOrder(model="author", program=HELLO))
        assert not wait_until(console, lambda view: view.may_be_approved).may_be_asked_again
        with pytest.raises(MissionError, match="can be asked again only"):
            session.ask_again(repair=False)


def test_problems_need_explicit_approval(console: Console) -> None:
    view = begin_and_check(console, BAD)
    session = console.session
    assert session is not None
    assert '"cellar"' in view.problems[0]
    with pytest.raises(MissionError, match="problems"):
        session.approve(view.digest)
    assert console.view.state is MissionState.CHECKED
    session.approve(view.digest, despite_problems=True)
    assert wait_until(console, lambda view: view.is_over).state is MissionState.FAILED


def test_only_the_program_that_was_seen_can_be_approved(console: Console) -> None:
    seen = begin_and_check(console)
    console.edit(HELLO.replace("hello", "bye"))
    session = console.session
    assert session is not None
    with pytest.raises(MissionError, match=r"changed|ready"):
        session.approve(seen.digest)
    wait_until(console, lambda view: view.check is not None)
    with pytest.raises(MissionError, match="changed"):
        session.approve(seen.digest)
    assert console.view.state is MissionState.CHECKED


def test_an_edited_program_keeps_the_instruction_only_if_it_is_similar(console: Console) -> None:
    written = "def task_program():\n    go_to('kitchen')\n    say('hello')\n    say('bye')\n"
    for program, instruction in (
        (written.replace("bye", "later"), "Greet the kitchen."),
        ("def task_program():\n    pick('mug')\n    place('mug')\n", ""),
    ):
        console.begin(MissionOrder("Greet the kitchen.", program=written, author="some:model"))
        wait_until(console, lambda view: view.check is not None)
        console.stop("a test")
        wait_until(console, lambda view: view.is_over)
        console.edit(program)
        view = wait_until(console, lambda view: view.check is not None)
        assert (view.instruction, view.author) == (instruction, "")
        filed = MissionSummary.read(console.home / "missions" / view.id)
        assert (filed.instruction, filed.model) == (instruction, "")


def test_an_edited_program_is_checked_again_and_the_last_one_counts(console: Console) -> None:
    begin_and_check(console)
    for number in range(5):
        console.edit(HELLO + f"    say('{number}')\n")
    view = wait_until(console, lambda view: view.check is not None)
    assert view.program.endswith("say('4')\n")
    assert not view.busy
    assert MissionSummary.read(console.home / "missions" / view.id).program == view.program


def test_a_program_can_be_edited_while_the_robot_connects(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on, connect = threading.Event(), Simulated.connect

    def slow(robot: Simulated) -> None:
        go_on.wait(20)
        connect(robot)

    monkeypatch.setattr(Simulated, "connect", slow)
    with make_console(tmp_path) as console:
        console.begin(MissionOrder(program=BAD))
        wait_until(console, lambda view: view.busy == "connecting the robot")
        console.edit(HELLO)
        go_on.set()
        view = wait_until(console, lambda view: view.check is not None)
        assert (view.program, view.problems) == (HELLO, ())
        assert MissionSummary.read(console.home / "missions" / view.id).program == HELLO


def test_a_stop_while_the_robot_connects_ends_the_mission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go_on, connect = threading.Event(), Simulated.connect

    def slow(robot: Simulated) -> None:
        go_on.wait(20)
        connect(robot)

    monkeypatch.setattr(Simulated, "connect", slow)
    with make_console(tmp_path) as console:
        session = console.begin(MissionOrder(program=HELLO))
        wait_until(console, lambda view: view.busy == "connecting the robot")
        began = time.monotonic()
        console.stop("a test")
        assert time.monotonic() - began < 1
        assert not console.view.is_over, "it has not stopped yet"
        go_on.set()
        session.join(10)
        assert (console.view.state, console.view.is_over, console.view.check) == (
            MissionState.STOPPED,
            True,
            None,
        )
        assert not console.view.progress.moments


def test_a_model_is_asked_again_with_its_program_and_the_problems(tmp_path: Path) -> None:
    author = Author(BAD, HELLO)
    with make_console(tmp_path, author=author) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        wait_until(console, lambda view: view.may_be_approved)
        session.ask_again(repair=True)
        view = wait_until(console, lambda view: view.may_be_approved and view.program == HELLO)
        assert view.problems == ()
        assert "cellar" in author.asked[1].messages[-1].text


def test_a_model_that_fails_when_asked_again_changes_nothing(tmp_path: Path) -> None:
    author = Author(BAD)
    with make_console(tmp_path, author=author) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        wait_until(console, lambda view: view.may_be_approved)
        console.edit(HELLO)
        before = wait_until(console, lambda view: view.may_be_approved and view.program == HELLO)
        session.ask_again(repair=False)
        view = wait_until(console, lambda view: bool(view.error))
        assert view.error == "the model is not there"
        assert (view.program, view.check, view.state) == (HELLO, before.check, MissionState.CHECKED)
        session.approve(view.digest)
        assert wait_until(console, lambda view: view.is_over).state is MissionState.DONE
        assert console.view.program == HELLO


def test_a_stopped_request_restores_the_program(tmp_path: Path) -> None:
    author = Author(HELLO, BAD)
    with make_console(tmp_path, author=author) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        wait_until(console, lambda view: view.may_be_approved)
        author.waits = True
        session.ask_again(repair=False)
        view = wait_until(console, lambda view: view.reply == BAD[:10])
        assert (view.state, view.phase) == (MissionState.CHECKED, "writing")
        console.stop("a test")
        assert wait_until(console, lambda view: view.is_over).program == HELLO


def test_no_other_program_is_asked_for_while_one_is_being_approved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with make_console(tmp_path, author=Author(HELLO, BAD)) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        view = wait_until(console, lambda view: view.may_be_approved)
        approve = Mission.approve

        def slowly(mission: Mission, *, despite_problems: bool = False, by: str = "") -> None:
            thread.start()
            thread.join(0.2)
            approve(mission, despite_problems=despite_problems, by=by)

        refused: list[MissionError] = []

        def ask() -> None:
            try:
                session.ask_again(repair=False)
            except MissionError as error:
                refused.append(error)

        thread = threading.Thread(target=ask)
        monkeypatch.setattr(Mission, "approve", slowly)
        session.approve(view.digest)
        view = wait_until(console, lambda view: view.is_over)
        thread.join()
        assert (view.state, view.phase, view.program, len(refused)) == (MissionState.DONE, "done", HELLO, 1)


def test_a_stop_reaches_a_robot_that_is_asked_for_its_rooms(tmp_path: Path) -> None:
    is_cancelled = threading.Event()

    class Slow(FakeRobot):
        def cancel(self) -> None:
            super().cancel()
            is_cancelled.set()

    def answer(_skill: str, _first: str) -> RobotResult:
        if not is_cancelled.wait(10):
            return ["hall"]
        raise CancelledError

    with make_console(tmp_path, Slow(answer)) as console:
        session = console.begin(MissionOrder(program=HELLO))
        assert wait_until(console, lambda view: bool(view.id)).phase == "starting"
        console.stop("a test")
        session.join(5)
        assert (console.view.is_over, console.view.state, console.view.error) == (
            True,
            MissionState.STOPPED,
            "",
        )


def test_nothing_begins_while_a_skill_outlasts_a_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codebotler.missions.mission.STOP_GRACE_SECONDS", 0.1)
    is_asked, may_answer = threading.Event(), threading.Event()

    def never(skill: str, _first: str) -> RobotResult:
        if skill != "say":
            return ["hall"] if skill == "get_all_rooms" else "hall"
        is_asked.set()
        may_answer.wait(60)
        return None

    robot = FakeRobot(never)
    with make_console(tmp_path, robot) as console:
        begin_and_approve(console, "def task_program():\n    say('a')\n")
        assert is_asked.wait(30)
        console.stop("a person")
        wait_until(console, lambda view: view.is_over)
        with pytest.raises(MissionError):
            console.begin(MissionOrder(program=HELLO))
        with pytest.raises(NotReadyError):  # Another process would do the same.
            Reservation(console.robot, tmp_path).__enter__()
        time.sleep(0.1)
        cancels = robot.cancels
        assert console.stop("a person", only_moving=True, holds=True), "the robot may still move"
        wait_until(console, lambda _: robot.cancels > cancels, seconds=10)
        assert console.is_held
        may_answer.set()
        ends = time.monotonic() + 30
        while console.session is not None and console.session.is_stuck:
            assert time.monotonic() < ends
            time.sleep(0.01)
        console.begin(MissionOrder(program=HELLO))


def test_a_running_mission_is_not_disturbed(tmp_path: Path) -> None:
    with make_console(tmp_path, Simulated(WORLD)) as console:
        begin_and_approve(console, FAR)
        view = wait_until(console, lambda view: bool(view.progress.skill))
        assert (view.progress.doing, view.progress.line) == ('drives to "kitchen"', 3)
        with pytest.raises(MissionError, match="stop it first"):
            console.begin(MissionOrder(program=HELLO))
        with pytest.raises(MissionError, match="cannot be changed"):
            console.edit(HELLO)
        console.stop("a test")
        assert wait_until(console, lambda view: view.is_over).state is MissionState.STOPPED


def test_another_instruction_replaces_one_that_waits(console: Console) -> None:
    first = begin_and_check(console)
    console.begin(MissionOrder(program=BAD))
    wait_until(console, lambda view: view.check is not None and view.number > first.number)
    assert [summary.state for summary in read_missions(console.home)] == ["stopped", "checked"]


def test_the_robot_is_stopped_with_the_tool(tmp_path: Path) -> None:
    robot = Simulated(WORLD)
    with make_console(tmp_path, robot) as console:
        begin_and_approve(console, FAR)
        wait_until(console, lambda view: bool(view.progress.skill))
    assert read_missions(tmp_path)[0].state == "stopped"


def test_a_stop_between_the_approval_and_the_start_counts(tmp_path: Path) -> None:
    robot, starting, go_on = Simulated(WORLD, speed=None), threading.Event(), threading.Event()

    def keep_out(_rules: object) -> None:
        starting.set()
        go_on.wait(20)

    robot.keep_out = keep_out  # type: ignore[attr-defined]  # an optional method
    with make_console(tmp_path, robot) as console:
        session = console.begin(MissionOrder(program=HELLO))
        view = wait_until(console, lambda view: view.may_be_approved)
        assert not console.stop("a test", only_moving=True)
        session.approve(view.digest)
        assert starting.wait(20)
        assert console.stop("a test", only_moving=True)
        session._stop_button.ended.wait(20)
        go_on.set()
        assert wait_until(console, lambda view: view.is_over).state is MissionState.STOPPED
        assert not session.view.progress.visited


def test_a_stop_counts_while_the_approval_is_still_being_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a slow disk, this takes longer than a person needs to change their mind."""
    writing, go_on, write = threading.Event(), threading.Event(), Mission._write

    def slow(mission: Mission, event: str, /, **data: object) -> None:
        if data.get("state") is MissionState.APPROVED:
            writing.set()
            go_on.wait(20)
        write(mission, event, **data)

    monkeypatch.setattr(Mission, "_write", slow)
    with make_console(tmp_path, Simulated(WORLD, speed=None)) as console:
        session = console.begin(MissionOrder(program=HELLO))
        view = wait_until(console, lambda view: view.may_be_approved)
        approving = threading.Thread(target=session.approve, args=(view.digest,))
        approving.start()
        assert writing.wait(20)
        assert console.stop("a test", only_moving=True)
        session._stop_button.ended.wait(20)
        go_on.set()
        approving.join()
        assert wait_until(console, lambda view: view.is_over).state is MissionState.STOPPED
        assert not session.view.progress.visited


def test_a_draft_that_nobody_saw_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def slow(program: str, **how: Any) -> CheckResult:  # noqa: ANN401 - passed on
        begun.set()
        go_on.wait(20)
        return check(program, **how)

    monkeypatch.setattr("codebotler.missions.drafts.check", slow)
    with make_console(tmp_path) as console:
        console.begin(MissionOrder(program=HELLO))
        assert begun.wait(20)
        console.edit(f"{HELLO}# a comment\n")
        go_on.set()
        assert wait_until(console, lambda view: view.may_be_approved).earlier is None
        console.edit(HELLO)
        assert (
            wait_until(console, lambda view: view.may_be_approved and view.program == HELLO).earlier
            is not None
        )


@pytest.mark.slow
@pytest.mark.parametrize("is_edit", [False, True])
def test_a_check_that_nobody_wants_ends(tmp_path: Path, *, is_edit: bool) -> None:
    looks = "".join(f"    if is_in_room('t{number}'):\n        say('{number}')\n" for number in range(12))
    slow = f"def task_program():\n    for i in range(20):\n        sum(range(7 * 10**6))\n{looks}"
    with make_console(tmp_path) as console:
        session = console.begin(MissionOrder(program=slow))
        wait_until(console, lambda view: view.busy == "checking" and bool(view.id))
        time.sleep(0.3)
        if is_edit:
            session.edit(HELLO)
        else:
            console.begin(MissionOrder(program=HELLO))
        wait_until(console, lambda view: view.may_be_approved and view.program == HELLO)


@pytest.mark.slow
def test_a_check_does_not_delay_the_end(tmp_path: Path) -> None:
    slow = "def task_program():\n    while True:\n        sum(range(10**9))\n"
    with make_console(tmp_path) as console:
        session = console.begin(MissionOrder(program=slow))
        wait_until(console, lambda view: view.busy == "checking" and bool(view.id))
        time.sleep(0.3)
        began = time.monotonic()
        console.end()
        session.join(20)
        assert time.monotonic() - began < 5


def test_a_stop_does_not_wait_for_a_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()

    def slow(program: str, **how: Any) -> CheckResult:  # noqa: ANN401 - passed on
        go_on.wait(20)
        return check(program, **how)

    monkeypatch.setattr("codebotler.missions.drafts.check", slow)
    with make_console(tmp_path) as console:
        session = console.begin(MissionOrder(program=HELLO))
        wait_until(console, lambda view: view.busy == "checking" and bool(view.id))
        console.stop("a test")
        assert wait_until(console, lambda view: view.state is MissionState.STOPPED).check is None
        go_on.set()
        session.join(10)
        assert (console.view.state, console.view.check, console.view.is_over) == (
            MissionState.STOPPED,
            None,
            True,
        )


def test_missions_of_a_dead_tool_are_listed(tmp_path: Path) -> None:
    mission = Mission(tmp_path, "simulated")
    mission.set_program(HELLO)
    mission._close()
    with make_console(tmp_path) as console:
        assert [summary.id for summary in console.interrupted] == [mission.id]
        assert "ended unexpectedly" in console.interrupted[0].reason
    with make_console(tmp_path) as console:
        assert console.interrupted == (), "the robot has not moved"


def test_the_error_of_a_model_is_shown(tmp_path: Path) -> None:
    with make_console(tmp_path, author=Author()) as console:
        console.begin(MissionOrder("say hello", "author"))
        view = wait_until(console, lambda view: view.is_over)
        assert (view.error, view.state) == ("the model is not there", MissionState.FAILED)


def test_the_same_program_keeps_its_author_when_it_is_run_again(tmp_path: Path) -> None:
    with make_console(tmp_path, author=Author(HELLO)) as console:
        session = console.begin(MissionOrder("say hello", "author"))
        session.approve(wait_until(console, lambda view: view.may_be_approved).digest)
        wait_until(console, lambda view: view.is_over)
        for program, author in ((HELLO, "author"), (HELLO + "# mine\n", "")):
            console.edit(program)
            view = wait_until(console, lambda view: view.may_be_approved)
            assert (view.author, view.model, view.program) == (author, "author", program)
            console.stop("a test")
            wait_until(console, lambda view: view.is_over)
    assert [one.model for one in read_missions(tmp_path)] == ["author", "author", ""]


def test_a_mission_whose_end_cannot_be_logged_has_ended_in_the_view(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    add = mission_log.add_event

    def full(log: Appender, event: str, clock: float, **data: object) -> LogLine:
        if data.get("state") == MissionState.DONE:
            raise OSError(errno.ENOSPC, "No space left on device")
        return add(log, event, clock, **data)

    monkeypatch.setattr("codebotler.missions.mission.add_event", full)
    with make_console(tmp_path) as console:
        begin_and_approve(console)
        view = wait_until(console, lambda view: view.is_over)
        assert (view.state, view.phase) == (MissionState.DONE, "done")
        assert "No space left" in view.error


def test_the_first_model_writes_if_none_is_named(tmp_path: Path) -> None:
    with make_console(tmp_path, author=Author(HELLO)) as console:
        console.begin(MissionOrder("say hello"))
        assert wait_until(console, lambda view: view.may_be_approved).model == console.models[0]


def test_an_empty_order_is_refused() -> None:
    with pytest.raises(UserError, match="instruction is empty"):
        MissionOrder(" ", "author", program="\n")


def test_a_program_that_is_too_long_is_refused(console: Console) -> None:
    with pytest.raises(UserError, match="the limit is"):
        console.begin(MissionOrder(program="#" * (MAX_PROGRAM_CHARACTERS + 1)))
    assert read_missions(console.home) == []


def test_a_robot_that_is_used_elsewhere_is_not_waited_for(tmp_path: Path) -> None:
    with make_console(tmp_path) as one, make_console(tmp_path) as other:
        begin_and_check(one)
        other.begin(MissionOrder(program=HELLO))
        view = wait_until(other, lambda view: view.is_over)
        assert "robot simulated" in view.error
        assert view.id == ""


def test_viewers_are_woken_at_each_change(console: Console) -> None:
    async def watch() -> bool:
        session = console.begin(MissionOrder(program=HELLO))
        return await console.notifier.until(lambda: session.view.check is not None, 10.0)

    assert asyncio.run(watch())
    assert not asyncio.run(console.notifier.until(lambda: False, 0.01))


def test_a_view_keeps_only_the_last_moments(tmp_path: Path) -> None:
    """Unread changes do not pile up, since a viewer reads only the current view."""
    answers: dict[str, RobotResult] = {"get_all_rooms": ["hall"], "get_current_location": "hall"}
    robot = FakeRobot(lambda skill, _: answers.get(skill))
    with make_console(tmp_path, robot) as console:
        begin_and_approve(console, "def task_program():\n    for n in range(300):\n        say(str(n))\n")
        view = wait_until(console, lambda view: view.is_over)
        assert view.state is MissionState.DONE
        assert len(view.progress.moments) == 200
        assert console.session is not None
        assert len(console.session.events()) > 900


def test_a_digest_tells_programs_apart() -> None:
    assert program_digest(HELLO) != program_digest(BAD)
    assert program_digest("\ud800")


def test_nobody_waits_for_changes_after_the_end() -> None:
    async def wait() -> bool:
        notifier = Notifier()
        waiting = asyncio.ensure_future(notifier.until(lambda: False))
        await asyncio.sleep(0)
        notifier.close()
        return await asyncio.wait_for(waiting, 5) or await notifier.until(lambda: False)

    assert asyncio.run(wait()) is False


def test_hold_after_a_stop_outlasts_a_clock_that_is_set_back(tmp_path: Path) -> None:
    with make_console(tmp_path, Simulated(WORLD)) as console:
        begin_and_approve(console, FAR)
        console._began = time.time() + 3600  # The clock is set back by an hour now.
        assert console.stop("a person", holds=True)
        wait_until(console, lambda view: view.is_over)
        console.begin(MissionOrder(program=HELLO))
        assert console.is_held


def lose(skill: str, _first: str) -> RobotResult:
    if skill == "say":
        raise RobotLostError("the line is dead")
    return ["hall"] if skill == "get_all_rooms" else "hall"


def run_and_lose(console: Console) -> MissionSession:
    begin_and_approve(console, "def task_program():\n    say('a')\n")
    assert wait_until(console, lambda view: view.is_over).state is MissionState.FAILED
    assert console.session is not None
    console.session.join(10)
    return console.session


def test_each_press_reaches_a_robot_that_was_lost(tmp_path: Path) -> None:
    robot = FakeRobot(lose)
    with make_console(tmp_path, robot) as console:
        run_and_lose(console)
        assert "the line is dead" in console.warning
        for _ in range(2):
            cancels = robot.cancels
            assert console.stop("a person", only_moving=True), "it may still move"
            wait_until(console, lambda _, before=cancels: robot.cancels > before)  # type: ignore[misc]  # mypy does not infer such lambdas
        known: dict[str, RobotResult] = {"get_all_rooms": ["hall"], "get_current_location": "hall"}
        robot.answer = lambda skill, _: known.get(skill)
        console.begin(MissionOrder(program=HELLO))
        wait_until(console, lambda view: view.may_be_approved)
        time.sleep(0.05)
        assert robot.cancels == 0, "the next mission is not stopped with the lost one"
        assert console.stop("a person", only_moving=True), "a waiting mission is connected to this robot"
        wait_until(console, lambda view: view.is_over)
        begin_and_approve(console, "def task_program():\n    say('a')\n")
        console.stop("a person", holds=True)
        assert console.warning == "", "this robot was not lost"
        wait_until(console, lambda view: view.is_over)
        begin_and_check(console)
        assert console.warning == "", "a person has approved a mission since"
        assert not console.stop("a person", only_moving=True), "the next one only waits"


def test_nothing_begins_while_a_stop_of_a_lost_robot_is_under_way(tmp_path: Path) -> None:
    may_return = threading.Event()
    robot = FakeRobot(lose)
    with make_console(tmp_path, robot) as console:
        run_and_lose(console)
        robot.cancel = lambda: may_return.wait(30) and None  # type: ignore[assignment,method-assign]  # hangs
        console.stop("a person")
        stopping = console._stopping
        console.stop("a person")
        assert console._stopping is stopping, "a second press does not hide the first one"
        with pytest.raises(MissionError):
            console.begin(MissionOrder(program=HELLO))
        may_return.set()
        console._stopping.join(10)
        console.begin(MissionOrder(program=HELLO))


def test_stop_reaches_a_lost_robot_while_the_next_mission_connects(tmp_path: Path) -> None:
    robot = FakeRobot(lose)
    with make_console(tmp_path, robot) as console:
        run_and_lose(console)
        cancels, may_connect = robot.cancels, threading.Event()
        robot.connect = lambda: may_connect.wait(30) and None  # type: ignore[assignment,method-assign]  # slowly
        console.begin(MissionOrder(program=HELLO))
        console.stop("a person")
        wait_until(console, lambda _: robot.cancels > cancels, seconds=10)
        may_connect.set()


def test_stop_reaches_a_robot_that_connects(tmp_path: Path) -> None:
    robot, may_connect = FakeRobot(lose), threading.Event()
    robot.connect = lambda: may_connect.wait(30) and None  # type: ignore[assignment,method-assign]  # slowly
    with make_console(tmp_path, robot) as console:
        console.begin(MissionOrder(program=HELLO))
        wait_until(console, lambda view: view.busy == "connecting the robot")
        time.sleep(0.05)
        console.stop("a person")
        wait_until(console, lambda _: robot.cancels > 0, seconds=10)
        may_connect.set()


@pytest.mark.parametrize("only_moving", [True, False])
def test_stop_reaches_a_mission_of_another_process(tmp_path: Path, *, only_moving: bool) -> None:
    with make_console(tmp_path, Simulated(WORLD)) as one, make_console(tmp_path) as other:
        assert not other.stop("a person", only_moving=True, holds=True), "nothing uses the robot"
        assert other.is_held, "agents wait for a person"
        time.sleep(3 * HOLD_POLL_SECONDS)  # until the other process has heard this press
        begin_and_approve(one, FAR)
        wait_until(one, lambda view: view.is_running)
        time.sleep(0.05)  # file systems keep coarse times
        other.stop("a person", only_moving=only_moving, holds=True)
        assert "another tool (process" in other.used_elsewhere
        view = wait_until(one, lambda view: view.is_over)
        assert (view.state, "another process" in view.reason) == (MissionState.STOPPED, True)
        assert one.is_held


def test_each_press_reaches_a_robot_that_another_process_has_lost(tmp_path: Path) -> None:
    robot = FakeRobot(lose)
    with make_console(tmp_path, robot) as one, make_console(tmp_path, FakeRobot(lose)) as other:
        run_and_lose(one)
        wait_until(one, lambda _: "the line is dead" in other.warning)
        for _ in range(2):
            cancels = robot.cancels
            assert not other.stop("a person", only_moving=True, holds=True), "it has nothing to stop itself"
            wait_until(one, lambda _, before=cancels: robot.cancels > before)  # type: ignore[misc]  # mypy does not infer such lambdas
        assert one.session is not None
        assert "line is dead" in one.session.view.reason
    assert "the line is dead" in one.warning
    again = make_console(tmp_path, FakeRobot(lose))
    with again:
        assert "the line is dead" in again.warning, "also after a restart"


def test_robots_with_long_addresses_have_holds_of_their_own(tmp_path: Path) -> None:
    one, other = FakeRobot(), FakeRobot()
    one.address, other.address = (f"/{'long' * 80}/{arm}/robot.py:Rob" for arm in ("left", "right"))
    with make_console(tmp_path, one) as first, make_console(tmp_path, other) as second:
        first.stop("a person", holds=True)
        wait_until(first, lambda _: not first._hold._writer.is_alive())
        assert (first.is_held, second.is_held) == (True, False)


def test_a_press_in_another_process_ends_a_proposal_and_a_recovery(tmp_path: Path) -> None:
    with make_console(tmp_path) as one, make_console(tmp_path) as other:
        begin_and_check(one)
        session = one.session
        other.stop("a person", holds=True)
        wait_until(one, lambda view: view.is_over)
        with pytest.raises(MissionError):
            one.begin(MissionOrder(program=HELLO), after=session)
        begin_and_approve(one)
        assert wait_until(one, lambda view: view.is_over).state is MissionState.DONE, "a person has approved"
        begin_and_check(one)
        assert not one.is_held


def test_a_warning_is_short_and_visible(tmp_path: Path) -> None:
    def talk(skill: str, first: str) -> RobotResult:
        if skill == "say":
            raise RobotLostError("no words\n\x1b[2J" + "x" * 2_000)
        return lose(skill, first)

    with make_console(tmp_path, FakeRobot(talk)) as console:
        run_and_lose(console)
        assert len(console.warning) < 1_000
        assert console.warning.isprintable()


def test_after_a_loss_a_person_must_approve(tmp_path: Path) -> None:
    with make_console(tmp_path, FakeRobot(lose)) as console:
        run_and_lose(console)
        assert console.is_held
        console.stop("an agent")
        console.begin(MissionOrder(program=HELLO))
        assert console.is_held
    wait_until(console, lambda _: make_console(tmp_path, FakeRobot(lose)).is_held)


def test_end_stops_a_robot_that_was_lost(tmp_path: Path) -> None:
    robot = FakeRobot(lose)
    with make_console(tmp_path, robot) as console:
        run_and_lose(console)
        cancels = robot.cancels
    assert robot.cancels > cancels


def test_no_stop_waits_for_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    may_write, writers = threading.Event(), list[threading.Thread]()

    def write_slowly(*_: object, **__: object) -> None:
        writers.append(threading.current_thread())
        may_write.wait(30)

    with make_console(tmp_path, Simulated(WORLD)) as console:
        begin_and_approve(console, FAR)
        wait_until(console, lambda view: bool(view.progress.skill))
        monkeypatch.setattr("os.utime", write_slowly)
        console.stop("a person", holds=True)
        assert console.is_held
        assert wait_until(console, lambda view: view.is_over and bool(writers)).state is MissionState.STOPPED
        assert threading.current_thread() not in writers
        may_write.set()
