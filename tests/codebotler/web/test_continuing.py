"""The console continues missions that ended early: at a person's word, or by itself if a skill failed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import ValueType
from codebotler.core.trace import Event
from codebotler.core.world import Room, World
from codebotler.missions import recovery
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.mission import MissionError
from codebotler.missions.recovery import ask_evidence, is_recoverable
from codebotler.missions.session import MissionSession
from codebotler.missions.stop import StopButton
from codebotler.missions.storage.log import MissionState, MissionSummary
from codebotler.missions.storage.past import MissionPast
from codebotler.models.base import Model, ModelError, Reply, TextListener, Usage, ignore_text
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt
from codebotler.robots.base import (
    CancelledError,
    Feedback,
    Robot,
    RobotArgument,
    RobotResult,
    ignore_feedback,
)
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from codebotler.web import console as console_module
from codebotler.web.console import Console
from codebotler.web.panes.continuing import origin_text, storyboard_title
from codebotler.web.panes.robot import map_state
from codebotler.web.storyboard import strips
from ended import cut, failed_mission, line_of

WORLD = World((Room("hall"), Room("kitchen"), Room("study")), "hall")
FETCH = "def task_program():\n    go_to('kitchen')\n    pick('mug')\n    say('done')\n    go_to('hall')\n"
GO_BACK = "def task_program():\n    go_to('hall')\n"
SEEK = (
    "def task_program():\n    go_to('kitchen')\n    pick('mug')\n"
    "    place('mug')\n    go_to('study')\n    pick('mug')\n"
)
ELSEWHERE = "def task_program():\n    go_to('study')\n"
TYPED = "def task_program():\n    go_to('kitchen')\n    say('hello')\n    go_to('cellar')\n"


class Author:
    """A model that writes one program after another, and may act before its last reply."""

    name = "author"
    settings = SamplingSettings()

    def __init__(self, *programs: str) -> None:
        self.programs = list(programs)
        self.asked: list[Prompt] = []
        self.before_last: Callable[[], object] = lambda: None

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:  # noqa: ARG002 - models take it
        self.asked.append(prompt)
        if not self.programs:
            raise ModelError("the model is not there", is_temporary=False)
        program = self.programs.pop(0)
        if not self.programs:
            self.before_last()
        return Reply(program, program, Usage(), 0.0, "stop")

    async def close(self) -> None:
        pass


def make_console(home: Path, author: Author, recoveries: int = 0, speed: float | None = None) -> Console:
    def model(_name: str) -> Model:
        return author

    robot = Simulated(WORLD, speed=speed)
    return Console(robot, home, model, models=("other", "author"), world=WORLD, recoveries=recoveries)


@pytest.fixture
def console(tmp_path: Path) -> Iterator[Console]:
    with make_console(tmp_path, Author()) as console:
        yield console


def wait_until(console: Console, holds: Callable[[SessionView], bool], seconds: float = 15.0) -> SessionView:
    ends = time.monotonic() + seconds
    while not holds(console.view):
        assert time.monotonic() < ends, console.view
        time.sleep(0.005)
    return console.view


def fetch(console: Console) -> SessionView:
    """Run the model's program, which fails because there is no mug."""
    session = console.begin(MissionOrder("Fetch the mug.", "author"))
    view = wait_until(console, lambda view: view.may_be_approved)
    assert view.problems == ()
    session.approve(view.digest)
    view = session.wait_until(lambda _: False)
    assert (view.state, session.view.number) == (MissionState.FAILED, 1)
    return view


def test_a_chosen_model_writes_the_rest(tmp_path: Path) -> None:
    with make_console(tmp_path, Author(FETCH)) as console:
        fetch(console)
        past = console.past_of("last")
        assert console.rest_of(past).model == "author"
        assert console.rest_of(past, model="other").model == "other"


def test_the_model_of_the_program_writes_the_rest_and_a_person_approves_it(tmp_path: Path) -> None:
    author = Author(FETCH, GO_BACK)
    with make_console(tmp_path, author) as console:
        before = fetch(console)
        past = console.past_of("last")
        session = console.begin(console.rest_of(past))
        assert map_state(session.view, WORLD).room == "kitchen"  # The robot has not been asked yet.
        view = wait_until(console, lambda view: view.may_be_approved)
        assert (view.model, view.instruction, view.program) == ("author", "Fetch the mug.", GO_BACK)
        assert view.past == past
        assert (past.mission, view.progress.room) == (before.id, "kitchen")
        assert "went to" in str(author.asked[-1].messages)
        assert (storyboard_title(view), storyboard_title(before)) == (
            "What the rest would do",
            "What the check expected",
        )
        assert (origin_text(before), before.id in origin_text(view)) == ("", True)
        session.approve(view.digest)
        assert session.wait_until(lambda _: False).state is MissionState.DONE


def test_a_mission_without_an_instruction_is_continued_from_its_program(tmp_path: Path) -> None:
    failed_mission(tmp_path, TYPED, WORLD, "")
    with make_console(tmp_path, Author()) as console:
        console.begin(console.rest_of(console.past_of("last")))
        view = wait_until(console, lambda view: view.check is not None)
        assert view.check is not None
        assert (view.program, view.model, view.may_be_edited) == (TYPED, "", True)
        assert any("hello" in one.message and "kitchen" in one.message for one in view.check.problems)
        (strip,) = strips(view.check)
        marked = [(deed.text, deed.is_repeated) for scene in strip.scenes for deed in scene.deeds]
        assert marked == [("hello", True)]
        console.edit(GO_BACK)
        view = wait_until(console, lambda view: view.program == GO_BACK and view.check is not None)
        assert (view.problems, view.past is None) == ((), False)


def test_the_past_is_kept_until_the_rest_has_begun(tmp_path: Path) -> None:
    author = Author(FETCH, GO_BACK)
    with make_console(tmp_path, author) as console:
        fetch(console)
        console.begin(console.rest_of(console.past_of("last")))
        view = wait_until(console, lambda view: view.may_be_approved)
        console.stop("a test")
        wait_until(console, lambda view: view.is_over)
        session = console.edit(GO_BACK)
        again = wait_until(console, lambda now: now.number == 3 and now.may_be_approved)
        assert (again.past, again.instruction) == (view.past, view.instruction)
        session.approve(again.digest)
        session.wait_until(lambda _: False)
        console.edit(GO_BACK)
        assert wait_until(console, lambda now: now.number == 4 and now.may_be_approved).past is None


def test_a_person_decides_about_an_unsure_step(tmp_path: Path) -> None:
    folder = failed_mission(tmp_path, TYPED, WORLD, "")
    cut(folder, line_of(folder, "say", "skill"), MissionState.RUNNING)
    with make_console(tmp_path, Author()) as console:
        assert [one.id for one in console.interrupted] == [folder.name]
        past = console.past_of(folder.name)
        with pytest.raises(UserError):
            console.rest_of(past)
        console.begin(console.rest_of(past.resolve(happened=True)))
        assert console.interrupted == ()
        view = wait_until(console, lambda view: view.check is not None)
        assert view.past is not None
        assert view.past.trace[-1].text == "hello"


def test_a_new_mission_removes_the_notice_of_another_one(tmp_path: Path) -> None:
    folder = failed_mission(tmp_path, TYPED, WORLD, "")
    cut(folder, line_of(folder, "say", "result"), MissionState.RUNNING)
    with make_console(tmp_path, Author()) as console:
        assert console.interrupted
        console.begin(MissionOrder(program=GO_BACK))
        assert console.interrupted == ()


class Immovable(Simulated):
    """A simulated robot that cannot be put where the log says it was."""

    resume = property()  # Without a getter, it counts as missing.


def test_evidence_comes_from_the_robot_and_the_log(tmp_path: Path) -> None:
    robot: Robot = Immovable(WORLD, speed=None)
    trace = (
        Event("goto", "kitchen", place="hall", destination="kitchen"),
        Event("pick", "mug", place="kitchen"),
    )
    past = MissionPast("1", "", "", TYPED, "", trace, "study", Event("say", "hello", place="study"))
    log, robot_says = ask_evidence(robot, tmp_path, past, lambda _: None, StopButton())
    assert "study" in log
    assert "mug" in log
    assert "hall" in robot_says
    noted: list[str] = []
    with Reservation(robot, tmp_path):
        assert "hall" not in ask_evidence(robot, tmp_path, past, noted.append, StopButton())[1]
    assert len(noted) == 1
    assert "hall" not in str(ask_evidence(Simulated(WORLD), tmp_path, past, noted.append, StopButton()))


class Silent(Immovable):
    """A robot that does not say where it is until it is cancelled."""

    def __init__(self, world: World) -> None:
        super().__init__(world, speed=None)
        self.was_asked, self.was_cancelled = threading.Event(), threading.Event()

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        if skill != "get_current_location":
            return super().perform(skill, arguments, feedback)
        self.was_asked.set()
        assert self.was_cancelled.wait(10)
        raise CancelledError

    def cancel(self) -> None:
        super().cancel()
        self.was_cancelled.set()


def test_stop_reaches_a_robot_that_is_asked_where_it_is(tmp_path: Path) -> None:
    robot, noted = Silent(WORLD), list[str]()
    past = MissionPast("1", "", "", TYPED, "", (), "", Event("say", "hello", place="study"))
    with Console(robot, tmp_path, lambda _: Author()) as console, ThreadPoolExecutor(1) as pool:
        evidence = pool.submit(console.ask_evidence, past, noted.append)
        assert robot.was_asked.wait(10)
        with pytest.raises(MissionError):
            console.ask_evidence(past, noted.append)
        assert console.stop("a person", only_moving=True, holds=True)
        assert evidence.result(10)
        assert console.used_elsewhere == ""
        assert len(noted) == 1
        assert console.is_held
        assert not console.stop("a person")


# --- recovery without a person


@pytest.mark.slow
def test_a_failed_skill_is_recovered_within_the_approval(tmp_path: Path) -> None:
    with make_console(tmp_path, Author(FETCH, GO_BACK), recoveries=1) as console:
        before = fetch(console)
        view = wait_until(console, lambda view: view.number == 2 and view.is_over)
        assert view.state is MissionState.DONE
        assert MissionSummary.read(tmp_path / "missions" / view.id).continues == before.id


def test_a_rest_beyond_the_approval_waits_for_a_person(tmp_path: Path) -> None:
    with make_console(tmp_path, Author(FETCH, ELSEWHERE), recoveries=1) as console:
        fetch(console)
        wait_until(console, lambda view: view.number == 2 and view.may_be_approved)
        time.sleep(0.05)
        assert console.view.state is MissionState.CHECKED


def test_a_rest_that_a_person_changes_waits_for_them(tmp_path: Path) -> None:
    author = Author(FETCH, GO_BACK)
    with make_console(tmp_path, author, recoveries=1) as desk:

        def change() -> None:
            assert desk.session is not None
            desk.session.is_changed_by_person = True  # as an edit would do

        author.before_last = change
        fetch(desk)
        view = wait_until(desk, lambda view: view.number == 2 and view.may_be_approved)
        time.sleep(0.05)
        assert desk.view.state is MissionState.CHECKED
        assert desk.session is not None
        with pytest.raises(MissionError):
            desk.session.approve(view.digest, is_person=False)
        desk.session.approve(view.digest)
        assert desk.session.wait_until(lambda _: False).state is MissionState.DONE


def test_a_persons_approval_of_a_rest_replaces_the_first_one(tmp_path: Path) -> None:
    beyond = "def task_program():\n    go_to('study')\n    say('done')\n"
    narrow = "def task_program():\n    go_to('study')\n    pick('mug')\n"
    again = "def task_program():\n    say('done')\n"  # within the first approval
    with make_console(tmp_path, Author(FETCH, beyond, again), recoveries=2) as console:
        fetch(console)
        wait_until(console, lambda view: view.number == 2 and view.may_be_approved)
        console.edit(narrow)
        view = wait_until(console, lambda view: view.program == narrow and view.may_be_approved)
        assert console.session is not None
        console.session.approve(view.digest)
        wait_until(console, lambda view: view.number == 3 and view.may_be_approved)
        time.sleep(0.05)
        assert (console.view.program, console.view.state) == (again, MissionState.CHECKED)


def test_a_mission_by_steps_has_no_program_to_continue(console: Console) -> None:
    steps = "# An agent chooses each call.\ndef task_program():\n    pass\n"
    order = console.rest_of(MissionPast("1", "Look around.", "agent x", steps, "", ()))
    assert (order.program, order.model) == ("", "other")


def test_a_mission_that_was_put_aside_is_still_offered(tmp_path: Path) -> None:
    with make_console(tmp_path, Author(FETCH, GO_BACK)) as console:
        before = fetch(console)
        console.edit(GO_BACK)
        view = wait_until(console, lambda now: now.number == 2 and now.may_be_approved)
        assert (view.past, console.unfinished) == (None, before.id)
        console.begin(console.rest_of(console.past_of(console.unfinished)))
        wait_until(console, lambda now: now.number == 3 and now.may_be_approved)
        assert console.unfinished == ""


def test_a_program_that_is_continued_keeps_its_author(console: Console) -> None:
    order = console.rest_of(MissionPast("1", "", "agent x", TYPED, "", ()))
    assert (order.program, order.author, order.model) == (TYPED, "agent x", "")


def test_after_an_own_skill_without_an_event_a_person_decides() -> None:
    silent = Skill("dispense", (), ValueType(None), "Dispense a portion.")
    view = SessionView(state=MissionState.FAILED, reason="PickInvalidObject: no mug", instruction="Go on.")
    failed = {"event": "error", "skill": "pick", "kind": "PickInvalidObject"}
    table = SKILLS.with_skill(silent)
    assert is_recoverable(view, [failed], table)
    assert not is_recoverable(view, [{"event": "result", "skill": "dispense"}, failed], table)


def test_recoveries_are_limited(tmp_path: Path) -> None:
    author = Author(SEEK, "def task_program():\n    go_to('study')\n    pick('mug')\n", GO_BACK)
    with make_console(tmp_path, author, recoveries=1) as console:
        fetch(console)
        wait_until(console, lambda view: view.number == 2 and view.is_over)
        assert console.view.state is MissionState.FAILED
        time.sleep(0.05)
        assert (console.view.number, len(author.programs)) == (2, 1)


def test_a_stop_before_the_recovery_ends_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = recovery.past_to_recover
    with make_console(tmp_path, Author(FETCH, GO_BACK), recoveries=1) as console:

        def stop_first(session: MissionSession, robot: Robot, home: Path) -> MissionPast | None:
            past = read(session, robot, home)
            console.stop("a test", only_moving=True)
            stopped.append(past)
            return past

        stopped: list[MissionPast | None] = []
        monkeypatch.setattr(console_module, "past_to_recover", stop_first)
        fetch(console)
        wait_until(console, lambda _: bool(stopped))
        time.sleep(0.05)
        assert stopped[0] is not None
        assert (console.view.number, console.view.is_over) == (1, True)


def test_a_stop_while_the_rest_is_written_leaves_nothing_to_run(tmp_path: Path) -> None:
    author = Author(FETCH, GO_BACK)
    with make_console(tmp_path, author, recoveries=1) as console:
        author.before_last = lambda: console.stop("a test")
        fetch(console)
        view = wait_until(console, lambda view: view.number == 2 and view.is_over)
        assert (view.state, view.progress.has_begun) == (MissionState.STOPPED, False)


def test_after_a_stop_by_key_a_person_must_approve(tmp_path: Path) -> None:
    author = Author(FETCH, GO_BACK)
    with make_console(tmp_path, author, recoveries=1) as console:
        author.before_last = lambda: console.stop("a test", only_moving=True)
        fetch(console)
        wait_until(console, lambda view: view.number == 2 and view.may_be_approved)
        time.sleep(0.05)
        assert console.view.state is MissionState.CHECKED


def test_a_stop_is_never_recovered(tmp_path: Path) -> None:
    far = "def task_program():\n    for _ in range(50):\n        go_to('kitchen')\n        go_to('hall')\n"
    with make_console(tmp_path, Author(far, GO_BACK), 3, speed=1.0) as console:
        session = console.begin(MissionOrder("Walk.", "author"))
        view = wait_until(console, lambda view: view.may_be_approved)
        session.approve(view.digest)
        wait_until(console, lambda view: view.is_running and view.progress.is_driving)
        console.stop("a test")
        session.join()
        assert console.view.state is MissionState.STOPPED
        time.sleep(0.05)
        assert console.view.number == 1


def test_a_crash_of_the_program_is_never_recovered(tmp_path: Path) -> None:
    crashes = "def task_program():\n    go_to('kitchen')\n    raise ValueError('odd')\n"
    with make_console(tmp_path, Author(crashes, GO_BACK), recoveries=3) as console:
        session = console.begin(MissionOrder("Walk.", "author"))
        view = wait_until(console, lambda view: view.may_be_approved)
        session.approve(view.digest, despite_problems=True)
        assert session.wait_until(lambda _: False).state is MissionState.FAILED
        time.sleep(0.05)
        assert console.view.number == 1


def test_a_key_pressed_while_the_recovery_is_approved_stops_the_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    approve = MissionSession.approve
    far = (
        "def task_program():\n    go_to('kitchen')\n    pick('mug')\n    go_to('hall')\n    go_to('study')\n"
    )
    back = "def task_program():\n    go_to('hall')\n    go_to('study')\n"
    with make_console(tmp_path, Author(far, back), 1, speed=50.0) as console:

        def watch(session: MissionSession, seen: str, *, by: str = "", is_person: bool = True) -> None:
            if by:
                console.stop("a test", only_moving=True)
            approve(session, seen, by=by, is_person=is_person)

        monkeypatch.setattr(MissionSession, "approve", watch)
        fetch(console)
        view = wait_until(console, lambda view: view.number == 2 and view.is_over)
        assert view.state is MissionState.STOPPED
