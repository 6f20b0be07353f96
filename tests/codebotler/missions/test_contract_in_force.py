"""A mission sends the robot no call that its contract does not allow."""

from __future__ import annotations

import json
import unicodedata
from pathlib import Path

import pytest

from codebotler.checking.contracts.file import contract_data
from codebotler.core.errors import RobotError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.core.text.text_template import TextTemplate
from codebotler.core.world import Room, World
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.mission import Mission, MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import EVENTS_FILE, LogLine, MissionState
from codebotler.models.recorded import open_recorded
from codebotler.robots.base import Robot, RobotResult
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import Simulated
from codebotler.simulator.guard.contract import Contract, RequestedCall, SkillBound
from codebotler.simulator.guard.house_rule import UNKNOWN_ROOM
from codebotler.simulator.worlds.room_map import RoomMap
from doubles import FakeRobot

ROOMS = RoomMap(("hall", "kitchen", "the vault", "café"), "hall", plain=True)
HOUSE = World((Room("hall"), Room("kitchen", ("mug", "plate")), Room("vault")), "hall")
STUBBORN = """
def task_program():
    go_to("kitchen")
    while True:
        try:
            {}
        except BaseException:
            pass
        finally:
            say("I go on")
"""
FETCH = "def task_program():\n    go_to('kitchen')\n    pick('mug')\n    go_to('hall')\n    place('mug')\n"


def bound(**texts: list[str]) -> SkillBound:
    return SkillBound(tuple((name, tuple(map(TextTemplate.parse, some))) for name, some in texts.items()))


ALLOWED = Contract(
    {
        "go_to": bound(location=["hall", "kitchen", "café"]),
        "say": bound(message=["I go on", "there are {} mugs"]),
        "ask": bound(person=["Ann"], question=["Tea?"], options=["yes", "no"]),
        "pick": SkillBound(bound(obj=["mug"]).texts, places=("kitchen",), at_most=1),
    }
)


def run(
    folder: Path, robot: Robot, program: str, contract: Contract = ALLOWED, *, place: str = "hall"
) -> tuple[Mission, list[LogLine]]:
    mission = Mission(folder, robot.name)
    mission.set_program(program)
    mission.record_check([])
    mission.approve()
    with Reservation(robot, folder) as reserved, mission:
        mission.run(reserved, place, room_map=ROOMS, contracts=[contract])
    lines = (mission.folder / EVENTS_FILE).read_text().splitlines()
    return mission, [json.loads(line) for line in lines]


@pytest.mark.parametrize(
    "goal",
    [
        "the stairs between kitchen and café",
        "kitchenette",
        "my kitchen2",
    ],
)
def test_goal_that_is_not_one_listed_room_does_not_reach_the_robot(tmp_path: Path, goal: str) -> None:
    robot = FakeRobot()
    program = f"def task_program():\n    try: go_to({goal!r})\n    except Exception: go_to('kitchen')\n"
    mission, lines = run(tmp_path, robot, program)
    assert (mission.state, robot.done) == (MissionState.DONE, ["kitchen"])
    assert [goal in line["text"] for line in lines if line["event"] == "log"] == [True]


@pytest.mark.parametrize(
    "call",
    [
        "go_to('the vault')",
        "go_to('VAULT')",
        "go_to('  the  vault ')",
        "go_to('kitchen and the vault')",
        f"go_to({unicodedata.normalize('NFD', 'café')!r} + ' or the vault')",
        "go_to('.*')",
        "pick('plate')",
        "pick('mug.*')",
        "place('mug')",
        "say('there are two cups')",
        "say('I go on forever')",
        "ask('Bob', 'Tea?', ['yes', 'no'])",
        "ask('Ann', 'Tea?', ['yes', 'no', 'later'])",
        "ask('Ann', 'Coffee?', ['yes'])",
        "is_in_room('mug')",
    ],
)
def test_calls_beyond_the_contract_do_not_reach_the_robot(tmp_path: Path, call: str) -> None:
    robot = FakeRobot()
    mission, lines = run(tmp_path, robot, STUBBORN.format(call))
    assert (mission.state, mission.summary.reason) == (
        MissionState.STOPPED,
        "stopped by rule approved contract",
    )
    assert robot.done == ["kitchen"]
    assert robot.cancels
    (violation,) = [line for line in lines if line["event"] == "rule"]
    assert (violation["rule"], violation["prevented"], violation["line"]) == ("approved contract", True, 6)
    assert violation["why"]
    (approved,) = [line["contracts"] for line in lines if line["event"] == "contract"]
    assert approved == [contract_data(ALLOWED)]


def test_calls_within_the_contract_reach_the_robot(tmp_path: Path) -> None:
    program = f"""
def task_program():
    go_to("Kitchen ")
    go_to("to the kitchen")
    pick("MUG")
    go_to({unicodedata.normalize("NFD", "café")!r})
    say("there are 2 mugs")
    ask("Ann", "Tea?", ["no"])
"""
    robot = FakeRobot(lambda skill, _: "no" if skill == "ask" else None)
    mission, _ = run(tmp_path, robot, program)
    assert mission.state is MissionState.DONE


def test_every_contract_bounds_the_mission(tmp_path: Path) -> None:
    robot = FakeRobot()
    mission = Mission(tmp_path, robot.name)
    mission.set_program("def task_program():\n    go_to('kitchen')\n    go_to('hall')\n")
    mission.record_check([])
    mission.approve()
    with Reservation(robot, tmp_path) as reserved, mission:
        only_kitchen = Contract({"go_to": bound(location=["kitchen"])})
        mission.run(reserved, "hall", room_map=ROOMS, contracts=[ALLOWED, only_kitchen])
    assert mission.state is MissionState.STOPPED
    assert robot.done == ["kitchen"]


def test_a_call_too_many_stops_the_mission(tmp_path: Path) -> None:
    robot = FakeRobot()
    mission, _ = run(
        tmp_path, robot, "def task_program():\n    go_to('kitchen')\n    pick('mug')\n    pick('mug')\n"
    )
    assert mission.state is MissionState.STOPPED
    assert robot.done == ["kitchen", "mug"]


def test_a_failed_call_is_counted(tmp_path: Path) -> None:
    failures = iter([RobotError("PickFailed", "it slipped")])

    def answer(skill: str, _text: str) -> RobotResult:
        if skill == "pick" and (error := next(failures, None)) is not None:
            raise error
        return None

    program = """
def task_program():
    go_to("kitchen")
    try:
        pick("mug")
    except Exception:
        pick("mug")
"""
    mission, _ = run(tmp_path, FakeRobot(answer), program)
    assert mission.state is MissionState.STOPPED


TOUR = """
from codebotler import Simulation, skill

@skill(names="room")
def tour(sim: Simulation, rooms: list[str]) -> None:
    "Drive to several rooms."
"""


def test_a_list_for_a_drive_is_judged_by_its_own_texts(tmp_path: Path) -> None:
    (tmp_path / "tour.py").write_text(TOUR)
    row = skills_from(tmp_path / "tour.py")["tour"]
    call = RequestedCall.of(row, [("kitchen", "the cellar below the kitchen")], ["kitchen"], "hall")
    assert call.texts == (("kitchen", "the cellar below the kitchen"),)
    scalar = RequestedCall.of(SKILLS["go_to"], ["to the kitchen"], ["kitchen"], "hall")
    assert scalar.texts == (("kitchen",),)


def test_a_robot_without_a_known_position_picks_up_nothing(tmp_path: Path) -> None:
    def answer(skill: str, _text: str) -> RobotResult:
        if skill == "get_current_location":
            raise RobotError("Unknown", "the robot has not found its place yet")
        return None

    robot = FakeRobot(answer)
    _, lines = run(tmp_path, robot, "def task_program():\n    pick('mug')\n", place="")
    (violation,) = [line for line in lines if line["event"] == "rule"]
    assert violation["why"] == UNKNOWN_ROOM
    assert robot.done == []


def start_session(
    tmp_path: Path, program: str, *edits: str, within: Contract | None = None
) -> tuple[MissionSession, SessionView]:
    session = MissionSession(
        Simulated(HOUSE, speed=None),
        tmp_path,
        MissionOrder(program=program),
        open_model=open_recorded,
        world=HOUSE,
        within=within,
    )
    session.start()
    view = session.wait_until(lambda view: view.may_be_approved)
    for edit in edits:
        session.edit(edit)
        view = session.wait_until(lambda view, edit=edit: view.program == edit and view.may_be_approved)  # type: ignore[misc]  # mypy infers no type of a default
    return session, view


def test_a_session_runs_the_program_within_its_own_contract(tmp_path: Path) -> None:
    session, view = start_session(tmp_path, FETCH)
    session.approve(view.digest)
    assert session.wait_until(lambda _: False).state is MissionState.DONE
    assert view.contract is not None
    assert set(view.contract.skills) == {"go_to", "pick", "place"}


def test_a_session_compares_an_edited_program_with_the_last_one(tmp_path: Path) -> None:
    session, view = start_session(tmp_path, FETCH, FETCH.replace("place('mug')", "say('here')"))
    session.stop("the test")
    assert view.contract is not None
    assert view.earlier is not None
    assert set(view.contract.excess_over(view.earlier).skills) == {"say"}


def test_a_session_refuses_a_program_beyond_the_contract_of_its_start(tmp_path: Path) -> None:
    session, view = start_session(tmp_path, FETCH, within=ALLOWED)
    assert [problem.split(":")[0] for problem in view.problems] == ["OutsideContract"]
    with pytest.raises(MissionError):
        session.approve(view.digest)
    session.approve(view.digest, despite_problems=True)
    assert session.wait_until(lambda _: False).state is MissionState.STOPPED


def test_answers_of_the_robot_do_not_widen_the_contract(tmp_path: Path) -> None:
    answers: dict[str, RobotResult] = {"get_all_rooms": ["hall", "the vault"], "get_current_location": "hall"}
    robot = FakeRobot(lambda skill, _: answers.get(skill))
    program = "def task_program():\n    for room in get_all_rooms():\n        go_to(room)\n"
    mission, _ = run(tmp_path, robot, program)
    assert mission.state is MissionState.STOPPED
    assert "the vault" not in robot.done
