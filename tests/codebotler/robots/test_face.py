"""A robot with a face speaks and asks there, does all else itself, and withdraws questions at a stop."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Recording, Skill
from codebotler.core.skills.values import NO_VALUE, TEXT_TYPE, ValueType
from codebotler.core.trace import Event
from codebotler.core.world import Room, World
from codebotler.missions.mission import Mission
from codebotler.missions.preflight import missing_skills, resume_robot
from codebotler.missions.storage.log import MissionState, read_events
from codebotler.missions.storage.past import MissionPast
from codebotler.robots.base import AnswerError, CancelledError, Options, RobotArgument
from codebotler.robots.face import (
    ASK_TIMEOUT,
    Face,
    FaceQuestion,
    RobotWithFace,
    without_speech,
)
from codebotler.robots.open import ROBOT_KINDS, open_with_face
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from doubles import FakeRobot

TEA = """def task_program():
    say("Good morning")
    answer = ask("ann", "Tea?", ["Yes", "No"])
    say("She says " + answer)
"""
PATIENT = """def task_program():
    try:
        ask("ann", "Tea?", ["Yes", "No"])
    except Exception as error:
        say(type(error).__name__ + ": " + str(error))
"""
WORLD = World((Room("hall"), Room("kitchen")), "hall")
LONG = 30.0


def with_face(seconds: float = LONG) -> tuple[RobotWithFace, Face]:
    face = Face(seconds)
    return RobotWithFace(Simulated(WORLD, speed=None, skills=without_speech()), face), face


def await_question(face: Face, number: int = 0) -> FaceQuestion:
    """Wait for a question with a number above this one."""
    ends = time.monotonic() + LONG
    while (question := face.shown.question) is None or question.number <= number:
        assert time.monotonic() < ends
        time.sleep(0.002)
    return question


@contextmanager
def spawn(work: Callable[[], object]) -> Iterator[list[object]]:
    """Run work in a thread; at the end, the list holds its result or its error."""
    ended: list[object] = []

    def go() -> None:
        try:
            ended.append(work())
        except Exception as error:  # noqa: BLE001 - the test looks at it
            ended.append(error)

    thread = threading.Thread(target=go, daemon=True)
    thread.start()
    yield ended
    thread.join(LONG)
    assert not thread.is_alive()


@pytest.mark.parametrize("are_regexes", [True, False])
def test_rooms_are_regexes_if_those_of_the_inner_robot_are(are_regexes: bool) -> None:  # noqa: FBT001 - pytest passes it
    inner = FakeRobot()
    inner.rooms_are_regexes = are_regexes
    assert RobotWithFace(inner, Face()).rooms_are_regexes is are_regexes


def test_speech_goes_to_the_face_and_all_else_to_the_robot() -> None:
    inner, face = FakeRobot(lambda skill, _: ["hall"] if skill == "get_all_rooms" else None), Face()
    robot = RobotWithFace(inner, face)
    robot.connect()
    assert robot.perform("get_all_rooms", []) == ["hall"]
    robot.perform("go_to", ["kitchen"])
    robot.perform("say", ["hello"])
    assert inner.done == ["get_all_rooms", "kitchen"]
    assert [said.text for said in face.shown.said] == ["hello"]
    with spawn(lambda: robot.perform("ask", ["ann", "Tea?", ("Yes", "No", "Yes")])) as ended:
        question = await_question(face)
        assert (question.person, question.text, question.options) == ("ann", "Tea?", ("Yes", "No", "Yes"))
        face.answer(question.number, 2)
    assert ended == ["Yes"]
    assert (robot.name, robot.address, robot.if_tool_dies) == (inner.name, inner.address, inner.if_tool_dies)
    robot.disconnect()
    assert inner.connections == 0


def test_last_statements_stay_until_another_mission() -> None:
    robot, face = with_face()
    robot.connect()
    for text in "abcd":
        robot.perform("say", [text])
    assert [said.text for said in face.shown.said] == ["b", "c", "d"]
    robot.disconnect()
    assert face.shown.said
    robot.connect()
    assert not face.shown.said


def test_robot_may_lack_the_skills_of_the_face() -> None:
    inner = FakeRobot()
    inner.missing = {"say": "no server", "ask": "no server", "pick": "no arm"}
    robot = RobotWithFace(inner, Face())
    assert robot.missing == {"pick": "no arm"}
    assert missing_skills(TEA, robot) == []
    assert len(missing_skills(f"{TEA}    pick('mug')\n", robot)) == 1


def test_a_robot_with_a_face_resumes_a_mission_like_one_without() -> None:
    robot, _ = with_face()
    robot.connect()
    gone = Event("goto", "kitchen", place="hall")
    resume_robot(robot, MissionPast("1", "", "", TEA, "it failed", (gone,)))
    assert robot.perform("get_current_location", []) == "kitchen"


@pytest.mark.parametrize("kind", [kind for kind in ROBOT_KINDS if kind != "pyrobosim"])
def test_robot_behind_a_face_has_no_speech_skills(kind: str) -> None:
    robot = open_with_face(kind, Options(world=WORLD), Face())
    assert isinstance(robot, RobotWithFace)
    assert robot.skills == SKILLS
    assert set(robot._robot.skills) == set(SKILLS) - {"say", "ask"}


def test_own_speech_skills_are_shown_by_their_parameters() -> None:
    text = (Parameter("text"),)
    choose = (
        Parameter("choices", ValueType(is_list=True), is_options=True),
        Parameter("title"),
        Parameter("guest"),
    )
    table = SKILLS.with_skill(Skill("whisper", text, NO_VALUE, "Whisper.", Recording("whisper", "text")))
    row = Skill("choose", choose, TEXT_TYPE, "Let a guest choose.", Recording("choose", "title", "choices"))
    table = table.with_skill(row)
    face = Face(LONG)
    robot = RobotWithFace(Simulated(WORLD, speed=None, skills=without_speech(table)), face, table)
    robot.connect()
    robot.perform("whisper", ["psst"])
    assert [said.text for said in face.shown.said] == ["psst"]
    with spawn(lambda: robot.perform("choose", [("Tea", "Milk"), "A drink?", "ann"])) as ended:
        asked = await_question(face)
        assert (asked.person, asked.text, asked.options) == ("ann", "A drink?", ("Tea", "Milk"))
        face.answer(asked.number, 1)
    assert ended == ["Milk"]


def test_saying_takes_time_by_the_robots_clock() -> None:
    robot, _ = with_face()
    robot.connect()
    for text, seconds in (("hi", 1.0), ("x" * 60, 4.0), ("x" * 5_000, 14.0)):
        robot.perform("say", [text])
        assert robot.clock.now == seconds


def test_unanswered_question_times_out() -> None:
    robot, face = with_face(seconds=0.05)
    robot.connect()
    with pytest.raises(RobotError, match=r'"Tea\?" .*0\.05 s') as error:
        robot.perform("ask", ["ann", "Tea?", ("Yes",)])
    assert error.value.kind == ASK_TIMEOUT
    ended = face.shown.ended
    assert ended is not None
    assert (ended.how, face.shown.question) == ("unanswered", None)
    with pytest.raises(AnswerError, match="closed"):
        face.answer(ended.number, 0)


def test_the_first_answer_counts_and_later_ones_are_refused() -> None:
    robot, face = with_face()
    robot.connect()
    with spawn(lambda: robot.perform("ask", ["ann", "Tea?", ("Yes", "No")])) as ended:
        number = await_question(face).number
        for position in (-1, 2):
            with pytest.raises(AnswerError, match="not one of"):
                face.answer(number, position)
        with pytest.raises(AnswerError, match="closed"):
            face.answer(number + 1, 0)
        face.answer(number, 1)
        with pytest.raises(AnswerError, match="closed"):
            face.answer(number, 0)
    assert ended == ["No"]


def test_an_answer_to_an_earlier_question_is_refused() -> None:
    robot, face = with_face()
    robot.connect()
    with spawn(lambda: robot.perform("ask", ["ann", "Tea?", ("Yes", "No")])):
        first = await_question(face).number
        face.answer(first, 0)
    with spawn(lambda: robot.perform("ask", ["ann", "Sure?", ("Yes", "No")])) as ended:
        second = await_question(face, first).number
        with pytest.raises(AnswerError):
            face.answer(first, 0)
        face.answer(second, 1)
    assert ended == ["No"]


def test_a_stop_withdraws_the_question_and_silences_the_robot() -> None:
    robot, face = with_face()
    robot.connect()
    with spawn(lambda: robot.perform("ask", ["ann", "Tea?", ("Yes", "No")])) as ended:
        number = await_question(face).number
        robot.cancel()
        assert face.shown.question is None
        assert face.shown.ended is not None
        assert face.shown.ended.how == "withdrawn"
        with pytest.raises(AnswerError, match="closed"):
            face.answer(number, 0)
    assert isinstance(ended[0], CancelledError)
    calls: list[tuple[str, list[RobotArgument]]] = [
        ("say", ["hello"]),
        ("ask", ["ann", "Tea?", ("Yes",)]),
        ("go_to", ["kitchen"]),
    ]
    for skill, arguments in calls:
        with pytest.raises(CancelledError):
            robot.perform(skill, arguments)
    assert not face.shown.said
    robot.connect()
    robot.perform("say", ["hello"])


def test_a_stop_interrupts_a_statement() -> None:
    face = Face()
    robot = RobotWithFace(Simulated(WORLD, skills=without_speech()), face)
    robot.connect()
    with spawn(lambda: robot.perform("say", ["x" * 5_000])) as ended:
        while not face.shown.said:
            time.sleep(0.002)
        robot.cancel()
    assert isinstance(ended[0], CancelledError)


def test_the_robot_is_stopped_even_if_the_face_cannot_be() -> None:
    inner, face = FakeRobot(), Face()
    robot = RobotWithFace(inner, face)
    robot.connect()

    def broken() -> None:
        raise OSError("full")

    face.changed = broken
    with spawn(lambda: robot.perform("ask", ["ann", "Tea?", ("Yes",)])), pytest.raises(OSError, match="full"):
        robot.cancel()
    assert inner.cancels == 1


def test_screens_are_counted_and_reported() -> None:
    robot, face = with_face()
    robot.connect()
    phrases: list[object] = []
    changes: list[int] = []
    face.changed = lambda: changes.append(face.screens)
    robot.perform("say", ["a"], phrases.append)
    with face.count_screen(), face.count_screen():
        robot.perform("say", ["b"], phrases.append)
    with face.count_screen():
        robot.perform("say", ["c"], phrases.append)
    assert [re.findall(r"\bno\b|\d", str(text)) for text in phrases] == [["no"], ["2"], ["1"]]
    assert face.screens == 0
    assert changes == [0, 1, 2, 2, 1, 0, 1, 1, 0]


# --- missions


def run(home: Path, program: str, seconds: float, work: Callable[[Mission, Face], None]) -> Mission:
    robot, face = with_face(seconds)
    with Reservation(robot, home) as reserved, Mission(home, robot.name) as mission:
        mission.set_program(program)
        mission.record_check([])
        mission.approve()
        with spawn(lambda: mission.run(reserved)):
            work(mission, face)
        return mission


def test_a_mission_speaks_and_hears(tmp_path: Path) -> None:
    mission = run(tmp_path, TEA, LONG, lambda _, face: face.answer(await_question(face).number, 0))
    assert mission.state is MissionState.DONE
    assert [(event.kind, event.text, event.answer) for event in mission.trace] == [
        ("say", "Good morning", None),
        ("ask", "Tea?", "Yes"),
        ("say", "She says Yes", None),
    ]
    events = [line["event"] for line in read_events(mission.folder) if line["event"] not in {"state", "log"}]
    assert events == ["skill", "feedback", "result"] * 3


def test_a_stop_ends_a_mission_that_asks(tmp_path: Path) -> None:
    def stop(mission: Mission, face: Face) -> None:
        await_question(face)
        mission.stop("a test")
        assert face.shown.question is None

    mission = run(tmp_path, TEA, LONG, stop)
    assert mission.state == MissionState.STOPPED
    assert "by a test" in mission.summary.reason
    assert "cancelled" in [line["event"] for line in read_events(mission.folder)]


def test_a_program_can_catch_that_nobody_answers(tmp_path: Path) -> None:
    mission = run(tmp_path, PATIENT, 0.05, lambda _mission, _face: None)
    assert mission.state is MissionState.DONE
    silence = rf'{ASK_TIMEOUT}: .*"Tea\?" .*0\.05 s'
    assert re.match(silence, mission.trace[-1].text)
    failed = run(tmp_path, TEA, 0.05, lambda _mission, _face: None)
    assert failed.state is MissionState.FAILED
    assert re.match(silence, failed.summary.reason)
    (error,) = [line for line in read_events(failed.folder) if line["event"] == "error"]
    assert error["kind"] == ASK_TIMEOUT
