"""A program on a robot gets the simulator's answers and errors, until a stop."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Recording, Skill
from codebotler.core.skills.values import TEXT_TYPE, ValueType, written_call
from codebotler.core.trace import Event, Option
from codebotler.core.world import Person, Room, World
from codebotler.missions.live import LiveRobot, StoppedError
from codebotler.models.recorded import open_recorded
from codebotler.robots.base import CancelledError, RobotLostError, RobotResult
from codebotler.robots.simulated import Simulated
from codebotler.simulator.engine import run
from codebotler.simulator.settings import PAPER_SETTINGS
from codebotler.simulator.worker import Worker
from doubles import FakeRobot, fail_with, replay
from roboeval.suites.load import Suite

FOUND = True
OPTIONS = (Option("Yes"), Option(" no "))
WORLD = World((Room("hall"), Room("kitchen", ("mug",), (Person("ann", ("yes",)),))), "hall")


class Notes(list[tuple[str, dict[str, object]]]):
    def __call__(self, event: str, /, **data: object) -> None:
        self.append((event, data))

    @property
    def kinds(self) -> list[str]:
        return [event for event, _ in self]


def live_robot(answer: Callable[[str, str], RobotResult] = lambda *_: None) -> tuple[LiveRobot, Notes]:
    notes = Notes()
    return LiveRobot(FakeRobot(answer), notes, place="hall"), notes


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    worker = Worker()
    yield worker
    worker.close()


# --- agreement with the simulator


@pytest.mark.slow
def test_reference_programs_leave_the_simulators_traces(
    paper: Suite, worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codebotler.robots.simulated.METRES_PER_SECOND", math.inf)
    as_written = replace(PAPER_SETTINGS, literals="as-written")
    model = open_recorded("recorded:careful")
    pairs = [
        (model.solution(task.prompts[0], 0).program, task.scenarios[0].world) for task in paper.tasks.values()
    ]
    assert len(pairs) == 16
    expected = list(run(pairs, workers=1, settings=as_written))
    for (program, world), outcome in zip(pairs, expected, strict=True):
        robot = Simulated(world, speed=None)
        robot.connect()
        adapted = LiveRobot(robot, Notes(), place=world.robot, clock_starts=PAPER_SETTINGS.clock_starts)
        found = worker.run_live(program, adapted)
        assert (found.status, found.error) == (outcome.status, outcome.error)
        assert found.trace == outcome.trace


def test_error_quotes_a_question_without_options() -> None:
    given = (Parameter("choices", ValueType(is_list=True), is_options=True), Parameter("title"))
    row = Skill("choose", given, TEXT_TYPE, "Let somebody choose.", Recording("choose", "title", "choices"))
    answering = FakeRobot()
    answering.skills = SKILLS.with_skill(row)
    robot = LiveRobot(answering, Notes())
    with pytest.raises(RobotError, match='the question "A drink\\?" offers no options'):
        robot.perform("choose", [(), "A drink?"])


@pytest.mark.parametrize(
    ("call", "kind"),
    [
        ("go_to('cellar')", "GoToInvalidLocation"),
        ("ask('ann', 'Tea?', ['Yes', 'No'])", "AskNoPerson"),
        ("ask('ann', 'Tea?', [])", "AskEmptyOptions"),
        ("ask('ann', 'Tea?', ['Never', 'Always'])", "AskInvalidOptions"),
        ("pick('cup')", "PickInvalidObject"),
        ("place('mug')", "PlaceNoObject"),
        ("[pick('mug') for _ in 'ab']", "PickWhileHolding"),
    ],
)
@pytest.mark.parametrize("caught", [False, True])
def test_errors_reach_the_program_as_in_the_simulator(
    worker: Worker, call: str, kind: str, *, caught: bool
) -> None:
    where = "kitchen" if kind in {"AskInvalidOptions", "PickWhileHolding"} else "hall"
    body = f"    go_to('{where}')\n    {call}\n"
    if caught:
        body = f"    go_to('{where}')\n    try: {call}\n    except Exception as e: say(str(e))\n"
    program = f"def task_program():\n{body}"
    (expected,) = run([(program, WORLD)], workers=1, settings=replace(PAPER_SETTINGS, literals="as-written"))
    robot = Simulated(WORLD, speed=None)
    robot.connect()
    found = worker.run_live(program, LiveRobot(robot, Notes()))
    assert (found.status, found.error, found.line) == (expected.status, expected.error, expected.line)
    assert found.trace == expected.trace
    assert (found.error is None) == caught
    assert caught or (found.error and found.error.kind == kind)


# --- events


def test_trace_records_calls_and_their_results() -> None:
    robot, _ = live_robot(replay(None, FOUND, "Yes", None))
    robot.perform("go_to", [" kitchen "])
    robot.perform("is_in_room", ["mug"])
    assert robot.perform("ask", ["ann", "Tea?", OPTIONS]) == 0
    robot.perform("pick", ["mug"])
    assert robot.trace == (
        Event("goto", "kitchen"),
        Event("check", "mug", found=True),
        Event("ask", "Tea?", OPTIONS, "Yes"),
        Event("pick", "mug"),
    )
    assert [event.place for event in robot.trace] == ["hall", "kitchen", "kitchen", "kitchen"]


def test_notes_list_everything_in_order() -> None:
    robot, notes = live_robot(replay(None, "Yes"))
    robot.perform("say", ["hello"])
    robot.line = 3
    robot.sleep_until(5)
    robot.sleep_until(5.01)
    robot.line = None
    robot.perform("ask", ["ann", "Tea?", OPTIONS])
    one, two = {"number": 1, "skill": "say"}, {"number": 2, "skill": "ask"}
    named = {"person": "ann", "question": "Tea?", "options": ("Yes", " no ")}
    assert notes == [
        ("skill", {**one, "arguments": {"message": "hello"}}),
        ("feedback", {**one, "text": "doing say"}),
        ("result", {**one, "result": None}),
        ("sleep", {"seconds": 5, "line": 3}),
        ("skill", {**two, "arguments": named}),
        ("feedback", {**two, "text": "doing ask"}),
        ("result", {**two, "result": "Yes"}),
    ]
    assert robot.now == 5.01


def test_clock_begins_with_the_first_skill() -> None:
    robot, _ = live_robot()
    robot.robot.clock.wait(100)
    assert robot.now == 0
    robot.sleep_until(7)
    assert robot.now == 7


@pytest.mark.parametrize(("said", "position"), [("Yes", 0), (" no ", 1), ("NO", 1), ("yes ", 0)])
def test_answer_is_the_option_of_that_text(said: str, position: int) -> None:
    robot, _ = live_robot(replay(said))
    assert robot.perform("ask", ["ann", "Tea?", OPTIONS]) == position


def test_answer_that_was_not_offered_is_an_error() -> None:
    robot, notes = live_robot(replay("Perhaps"))
    with pytest.raises(RobotError, match="Perhaps") as error:
        robot.perform("ask", ["ann", "Tea?", OPTIONS])
    assert error.value.kind == "AskInvalidOptions"
    assert notes.kinds == ["skill", "feedback", "error"]
    assert robot.trace == (Event("ask", "Tea?", OPTIONS),)


def test_errors_keep_the_robots_own_words() -> None:
    robot, notes = live_robot(fail_with(RobotError("GoToInvalidLocation", "the door is shut")))
    with pytest.raises(RobotError, match="the door is shut"):
        robot.perform("go_to", ["kitchen"])
    assert notes.kinds == ["skill", "feedback", "error"]
    assert robot.trace == (Event("goto", "kitchen"),)
    with pytest.raises(RobotError):
        robot.perform("pick", ["mug"])
    assert robot.trace == (Event("goto", "kitchen"),), "a failed pick is not an event"


@pytest.mark.parametrize(
    ("skill", "arguments", "answer"),
    [
        ("is_in_room", ["mug"], "yes"),
        ("get_current_location", [], None),
        ("say", ["hello"], "hello"),
        ("get_all_rooms", [], "hall"),
        ("get_all_rooms", [], [1, None, {}]),
        ("get_all_rooms", [], ["hall", ["lab"]]),
    ],
)
def test_answer_that_the_skill_does_not_have_loses_the_robot(
    skill: str, arguments: list[str], answer: RobotResult
) -> None:
    robot, _ = live_robot(replay(answer))
    with pytest.raises(RobotLostError, match=f"answered {skill} with"):
        robot.perform(skill, arguments)


def test_own_skill_is_performed_and_noted() -> None:
    row = Skill("measure", (Parameter("what"),), TEXT_TYPE, "Measure.", Recording("measure", "what"))
    robot, notes = live_robot(replay("20 degrees"))
    robot.skills = SKILLS.with_skill(row)
    assert robot.perform("measure", ["the air"]) == "20 degrees"
    assert robot.trace == (Event("measure", "the air"),)
    assert notes.kinds == ["skill", "feedback", "result"]


def test_call_is_written_in_words() -> None:
    assert written_call("ask", ["ann", "Tea?", ("Yes", "No")]) == 'ask("ann", "Tea?", ["Yes", "No"])'


# --- stop


def test_nothing_starts_after_a_stop() -> None:
    robot, notes = live_robot()
    robot.stop()
    with pytest.raises(StoppedError):
        robot.perform("say", ["hello"])
    with pytest.raises(StoppedError):
        robot.sleep_until(3600)
    assert (notes, robot.trace) == ([], ())
    assert isinstance(robot.robot, FakeRobot)
    assert robot.robot.cancels == 1
    assert not robot.robot.clock.wait(1), "a sleeping program wakes up"


def test_answer_after_a_stop_is_ignored() -> None:
    def answer(_skill: str, _first: str) -> RobotResult:
        robot.stop()
        return True

    robot, notes = live_robot(answer)
    with pytest.raises(StoppedError):
        robot.perform("is_in_room", ["mug"])
    assert notes.kinds == ["skill", "feedback", "late"]


def test_error_after_a_stop_does_not_reach_the_program() -> None:
    def answer(_skill: str, _first: str) -> RobotResult:
        robot.stop()
        raise RobotError("GoToInvalidLocation", "the goal was cancelled")

    robot, _ = live_robot(answer)
    with pytest.raises(StoppedError):
        robot.perform("go_to", ["kitchen"])


def test_stop_by_another_client_ends_the_mission() -> None:
    robot, notes = live_robot(fail_with(CancelledError()))
    with pytest.raises(RobotLostError, match="another client"):
        robot.perform("go_to", ["kitchen"])
    assert notes.kinds == ["skill", "feedback", "cancelled"]


def test_feedback_that_cannot_be_noted_stops_the_robot() -> None:
    class FullError(OSError):
        pass

    def note(event: str, /, **_: object) -> None:
        if event == "feedback":
            raise FullError

    machine = FakeRobot()
    robot = LiveRobot(machine, note)
    with pytest.raises(FullError):
        robot.perform("say", ["hello"])
    assert machine.cancels == 1
