"""Rules about the robot's position hold in simulation and on robots, or are refused at the start."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from codebotler.checking.check import check
from codebotler.core.skills.declaration import POSE_IN_ROOM
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Event
from codebotler.core.world import Point, Room, World, laid_out, rooms_along
from codebotler.core.world_file import read_world
from codebotler.missions.display.view import MissionOrder
from codebotler.missions.mission import Mission
from codebotler.missions.preflight import ask_rooms, expect_poses
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import EVENTS_FILE, LogLine, MissionState
from codebotler.models.recorded import open_recorded
from codebotler.robots.base import NotReadyError, Robot
from codebotler.robots.face import Face, RobotWithFace
from codebotler.robots.open import SpellingRobot
from codebotler.robots.reservation import Reservation
from codebotler.robots.ros.keepout import MASK_RESOLUTION, keepout_messages
from codebotler.robots.simulated import OFFICE, Simulated
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule, RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worker import Worker
from codebotler.simulator.worlds.robot import SimulatedRobot
from codebotler.simulator.worlds.room_map import RoomMap
from doubles import FakeRobot

WORLD = read_world(OFFICE)
MAP = RoomMap.of(WORLD)
AS_WRITTEN = SimulationSettings(literals="as-written")
THROUGH = "def task_program():\n    go_to('printer room 1')\n    go_to('printer room 3')\n    say('done')\n"
SLEEPS = "import time\n\n\ndef task_program():\n    time.sleep(60)\n"
AROUND = THROUGH.replace("1')\n", "1')\n    go_to('start_loc')\n    go_to('supply room')\n").replace(
    "room 3", "room 1"
)


def rule(formula: str, *, name: str = "house") -> Rule:
    return Rule(name, "Do as the house wants.", parse(formula, skills=SKILLS.with_skill(POSE_IN_ROOM)))


NEVER = rule('not tr.Exists(inside("printer room 2"))', name="never")


def run(folder: Path, robot: Robot, program: str, *rules: Rule) -> tuple[Mission, list[LogLine]]:
    mission = Mission(folder, robot.name)
    mission.set_program(program)
    mission.record_check([])
    mission.approve()
    with Reservation(robot, folder) as reserved, mission:
        room_map, place = ask_rooms(robot, mission.note, WORLD)
        mission.run(reserved, place, rules=rules, room_map=room_map)
    return mission, [json.loads(line) for line in (mission.folder / EVENTS_FILE).read_text().splitlines()]


# --- rooms along a line


def test_straight_line_enters_the_rooms_that_it_crosses_in_order() -> None:
    way = [*rooms_along(WORLD.rooms, (2, 3), (12, 3))]
    assert way == [("printer room 1",), (), ("printer room 2",), (), ("printer room 3",)]
    assert [*rooms_along(WORLD.rooms, (12, 3), (2, 3))] == way[::-1]
    assert [*rooms_along(WORLD.rooms, (7, 3), (7, 3))] == [("printer room 2",)]
    assert [*rooms_along(WORLD.rooms, (4.5, 1), (4.5, 1))] == [()]
    assert [*rooms_along([Room("somewhere")], (0, 0), (1, 0))] == [()]


def test_a_room_may_be_entered_twice_and_lie_within_another() -> None:
    legs = Room("u", footprint=((0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)))
    zone = Room("zone", footprint=((-1, 1.5), (9, 1.5), (9, 9), (-1, 9)))
    assert [*rooms_along([legs], (-1, 2), (4, 2))] == [(), ("u",), (), ("u",), ()]
    assert [*rooms_along([legs, zone], (0.5, 0.5), (0.5, 2))] == [("u",), ("u", "zone")]


def test_line_that_touches_a_corner_enters_no_room() -> None:
    square = Room("square", footprint=((1, 0), (2, 0), (2, 1), (1, 1)))
    assert {*rooms_along([square], (0, 0), (2, 2))} == {()}


# --- in simulation


@pytest.mark.slow
@pytest.mark.parametrize(("program", "line"), [(THROUGH, 3), (AROUND, None)])
def test_the_check_finds_a_drive_through_a_room(program: str, line: int | None) -> None:
    found = check(program, room_map=MAP, house_rules=[NEVER])
    assert [(one.kind, one.line) for one in found.problems] == ([("RuleViolation", line)] if line else [])
    assert all(event.kind != "inside" for sample in found.samples for event in sample.outcome.trace)


def test_a_world_without_footprints_has_those_of_the_grid() -> None:
    world = World(tuple(map(Room, ("a", "b", "c", "d", "e"))), "a")  # Rooms a, c and e are in one row.
    program = "def task_program():\n    go_to('e')\n"
    for room, problems in (("c", 1), ("b", 0)):
        never = rule(f'not tr.Exists(inside("^{room}$"))')
        assert len(check(program, room_map=RoomMap.of(world), house_rules=[never]).problems) == problems


def test_without_a_map_only_the_ends_of_drives_count() -> None:
    assert not check(THROUGH, house_rules=[NEVER]).problems
    assert check(THROUGH, house_rules=[rule('not tr.Exists(inside("room 3"))')]).problems


def drive(formula: str, *rooms: str) -> None:
    one = SimulatedRobot(WORLD, AS_WRITTEN, guard=RuleGuard([rule(formula)], MAP))
    for room in rooms:
        one.perform("go_to", [room])


@pytest.mark.parametrize(
    ("formula", "is_broken"),
    [
        ('not tr.Exists(inside("room 2"))', True),
        ('not tr.AtLeast(inside("room 2"), 2)', True),
        ('not tr.AtLeast(inside("room 2"), 3)', False),
        ('not tr.AtLeast(inside("room 1"), 2)', False),
        ('not tr.Last(inside("room 3")) or tr.BeforeLast(inside("room 3")).Last(inside("room 2"))', False),
        ('not tr.Last(inside("room 2")) or tr.BeforeLast(inside("room 2")).Exists(say("hello"))', True),
        ('not tr.Last(goto("room 3")) or tr.BeforeLast(goto("room 3")).Exists(inside("room 2"))', True),
        ('not tr.Exists(at("room 2", inside(".*")))', True),
        ('not tr.Exists(holding("mug", inside("room 2")))', False),
    ],
)
def test_formulas_may_count_and_order_rooms(formula: str, *, is_broken: bool) -> None:
    rooms = "printer room 1", "printer room 3", "printer room 2"
    if is_broken:
        with pytest.raises(RuleViolationError):
            drive(formula, *rooms)
    else:
        drive(formula, *rooms)


@pytest.mark.parametrize(
    "formula",
    [
        'tr.Count(goto(".*"), 0) or tr.Last(goto(".*"))',
        'not tr.AtLeast(goto(".*"), 3)',
        'not tr.Last(goto("room 3")) or tr.BeforeLast(goto("room 3")).Last(goto("room 1"))',
    ],
)
def test_rules_about_other_events_do_not_see_poses(formula: str) -> None:
    watched = [rule('not tr.Exists(inside("nowhere"))'), rule(formula)]
    one = SimulatedRobot(WORLD, AS_WRITTEN, guard=RuleGuard(watched, MAP))
    for room in ("printer room 1", "printer room 3"):
        one.perform("go_to", [room])
    assert [event.kind for event in one.trace] == ["goto", "goto"]


def test_a_skill_of_a_user_drives_through_rooms_too(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from codebotler import Simulation, skill\n@skill\ndef tour(sim: Simulation) -> None:\n"
        "    'Tour.'\n    for n in '13': sim.drive(f'printer room {n}')\n"
        "    sim.drive('start_loc')\n    sim.look('mug')\n"
    )
    skills = skills_from(tmp_path / "own.py")
    one = SimulatedRobot(WORLD, AS_WRITTEN, skills, guard=RuleGuard([NEVER], MAP))
    with pytest.raises(RuleViolationError):
        one.perform("tour", [])
    all_rooms = rule('not tr.Exists(check("mug")) or tr.Count(inside(".*"), 6)')  # It is judged twice.
    SimulatedRobot(WORLD, AS_WRITTEN, skills, guard=RuleGuard([all_rooms], MAP)).perform("tour", [])


def test_skill_that_drives_around_a_room_has_not_been_inside(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from codebotler import Simulation, skill\n@skill(verb='circle to {room}', names='room')\n"
        "def circle(sim: Simulation, room: str) -> None:\n"
        "    'Circle.'\n    sim.drive('supply room')\n    sim.drive(room)\n"
    )
    skills = skills_from(tmp_path / "own.py")
    one = SimulatedRobot(WORLD, AS_WRITTEN, skills, guard=RuleGuard([NEVER], MAP))
    one.perform("go_to", ["printer room 1"])
    one.perform("circle", ["printer room 3"])
    assert one.room == "printer room 3"


# --- while the robot moves


@pytest.mark.parametrize(
    ("speed", "wrapped"),
    [(None, ""), (100.0, ""), (None, "face"), pytest.param(None, "spelling", marks=pytest.mark.slow)],
)
def test_a_robot_is_stopped_where_its_pose_enters_a_forbidden_room(
    tmp_path: Path, speed: float | None, wrapped: str
) -> None:
    robot: Robot = Simulated(WORLD, speed=speed)
    if wrapped:
        robot = with_face(robot) if wrapped == "face" else with_spelling(robot)
    assert robot.has_pose
    mission, lines = run(tmp_path, robot, THROUGH, NEVER)
    assert (mission.state, mission.summary.line) == (MissionState.STOPPED, 3)
    (row,) = [line for line in lines if line["event"] == "rule"]
    assert (row["rule"], row["what"], row["prevented"]) == ("never", ["inside", "printer room 2"], False)
    assert [line["arguments"] for line in lines if line["event"] == "skill"][-1] == {
        "location": "printer room 3"
    }
    assert all(event.kind == "goto" for event in mission.trace)


def test_the_first_drive_is_judged_from_where_the_robot_stands(tmp_path: Path) -> None:
    program = "def task_program():\n    go_to('printer room 3')\n"
    mission, _ = run(tmp_path, Simulated(WORLD, speed=None), program, NEVER)
    assert mission.state is MissionState.STOPPED


def test_a_robot_that_goes_around_is_not_stopped(tmp_path: Path) -> None:
    mission, _ = run(tmp_path, Simulated(WORLD, speed=None), AROUND, NEVER)
    assert mission.state is MissionState.DONE


def test_robot_stops_before_the_rule_is_logged(tmp_path: Path) -> None:
    class Noting(Simulated):
        def cancel(self) -> None:
            logged.append((next(tmp_path.glob("missions/*")) / EVENTS_FILE).read_text())
            super().cancel()

    logged: list[str] = []
    run(tmp_path, Noting(WORLD, speed=None), THROUGH, NEVER)
    assert '"event": "rule"' not in logged[0]
    assert '"event": "rule"' in logged[-1]


# --- refusal at the start


def make_robot(*, has_pose: bool, rooms: tuple[str, ...] = ("hall", "vault")) -> FakeRobot:
    answers = {"get_all_rooms": [*rooms], "get_current_location": "hall"}
    robot = FakeRobot(lambda skill, _: answers.get(skill))  # type: ignore[arg-type, return-value]  # of these skills
    robot.has_pose = has_pose
    return robot


SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
VAULT = rule('not tr.Exists(inside("vault"))')


@pytest.mark.parametrize(
    ("has_pose", "world", "word"),
    [
        (False, World((Room("vault", footprint=SQUARE),), "vault"), "position"),
        (True, None, "footprint"),
        (True, World((Room("vault"), Room("hall", footprint=SQUARE)), "hall"), "footprint"),
        (True, World((Room("vault", footprint=SQUARE), Room("hall")), "hall"), ""),
    ],
)
def test_a_rule_that_cannot_be_enforced_is_refused_before_anything_moves(
    tmp_path: Path, *, has_pose: bool, world: World | None, word: str
) -> None:
    robot = make_robot(has_pose=has_pose)
    session = MissionSession(
        robot,
        tmp_path,
        MissionOrder(program="def task_program():\n    go_to('hall')\n"),
        open_model=open_recorded,
        rules=(VAULT,),
        world=world,
    )
    session.start()
    view = session.wait_until(lambda now: now.may_be_approved or now.is_over)
    if word:
        assert isinstance(session.error, NotReadyError)
        assert 'the rule "house"' in session.error.sentence
        assert word in session.error.sentence
        assert "hall" not in robot.done
    else:
        assert view.may_be_approved
        session.stop("a test")
    session.join(10)


def test_a_robot_without_a_list_of_rooms_has_no_footprints() -> None:
    robot = make_robot(has_pose=True)
    with pytest.raises(NotReadyError, match="footprint"):
        expect_poses([VAULT], robot, None)
    expect_poses([rule('not tr.Exists(goto("vault"))')], robot, None)


def test_check_assumes_straight_drives_only_for_the_simulated_robot() -> None:
    remarks: list[str] = []
    straight, _ = ask_rooms(Simulated(WORLD, speed=None), remarks.append, WORLD)
    other, _ = ask_rooms(make_robot(has_pose=True, rooms=tuple(MAP.rooms)), remarks.append, WORLD)
    assert straight is not None
    assert other is not None
    assert check(THROUGH, room_map=straight, house_rules=[NEVER]).problems
    assert not check(THROUGH, room_map=other, house_rules=[NEVER]).problems
    in_grid, _ = ask_rooms(
        Simulated(World((Room("hall"),), "hall")), remarks.append, World((Room("hall"),), "hall")
    )
    assert in_grid is not None
    assert in_grid.plan[0].footprint == laid_out(World((Room("hall"),), "hall")).rooms[0].footprint


# --- poses that arrive at any time, also between skills


class PushedRobot(Simulated):
    """A robot that is pushed from pose to pose once the program has begun."""

    def __init__(self, *poses: Point | None) -> None:
        super().__init__(WORLD, speed=20.0)
        self.poses = poses

    def watch(self, on_pose: Callable[[Point | None], None]) -> bool:
        def push() -> None:
            for pose in self.poses:
                on_pose(pose)

        threading.Thread(target=push, daemon=True).start()
        return True


def with_spelling(robot: Robot) -> Robot:
    return SpellingRobot(robot)


def with_face(robot: Robot) -> Robot:
    return RobotWithFace(robot, Face())


@pytest.mark.slow
@pytest.mark.parametrize("around", [with_spelling, with_face])
def test_a_pose_is_judged_also_while_no_skill_is_performed(
    tmp_path: Path, around: Callable[[Robot], Robot]
) -> None:
    mission, lines = run(tmp_path, around(PushedRobot((2.0, 3.0), (7.0, 3.0))), SLEEPS, NEVER)
    assert mission.state is MissionState.STOPPED
    assert [line["what"][:2] for line in lines if line["event"] == "rule"] == [["inside", "printer room 2"]]


def test_a_broken_rule_is_logged_even_if_the_mission_ends_before_its_stop_returns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop_late(worker: Worker) -> None:
        ended.wait(5)
        stop(worker)

    stop, ended = Worker.stop, threading.Event()
    monkeypatch.setattr(Worker, "stop", stop_late)
    monkeypatch.setattr(Mission, "__exit__", lambda *_: ended.set())
    mission, lines = run(tmp_path, PushedRobot((2.0, 3.0), (7.0, 3.0)), SLEEPS, NEVER)
    assert mission.state is MissionState.STOPPED
    assert [line["what"][:2] for line in lines if line["event"] == "rule"] == [["inside", "printer room 2"]]


def test_robot_whose_pose_becomes_unknown_is_stopped_and_lost(tmp_path: Path) -> None:
    mission, lines = run(tmp_path, PushedRobot((2.0, 3.0), None), SLEEPS, NEVER)
    assert mission.state is MissionState.FAILED
    assert not [line for line in lines if line["event"] == "rule"]


def test_poses_are_ignored_unless_a_rule_is_about_them(tmp_path: Path) -> None:
    short = "def task_program():\n    say('hello')\n"
    mission, _ = run(tmp_path, PushedRobot((2.0, 3.0), None), short, rule('not tr.Exists(goto("vault"))'))
    assert mission.state is MissionState.DONE


# --- for Nav2


def test_the_keepout_mask_holds_the_rooms_that_no_path_may_enter() -> None:
    also = rule('not tr.Exists(inside("supply")) and not tr.Exists(inside("printer room 2"))')
    grid, info = keepout_messages(
        [also, VAULT, rule('not tr.Exists(goto("room 1"))')], WORLD.rooms, "map", "/mask"
    )
    assert (info["type"], info["filter_mask_topic"], info["base"], info["multiplier"]) == (
        0,
        "/mask",
        0.0,
        1.0,
    )
    shape, origin = grid["info"], grid["info"]["origin"]["position"]
    assert len(grid["data"]) == shape["width"] * shape["height"]
    assert (grid["header"]["frame_id"], shape["resolution"]) == ("map", MASK_RESOLUTION)

    def cell(x: float, y: float) -> int:
        row, column = (int((a - origin[b]) / MASK_RESOLUTION) for a, b in ((y, "y"), (x, "x")))
        return int(grid["data"][row * shape["width"] + column])

    inside = {
        (x, y): cell(x, y) for x in (2.02, 4.97, 5.02, 7.0, 7.98) for y in (0.02, 3.97, 5.0, 6.02, 9.97)
    }
    for point, value in inside.items():
        names = next(rooms_along(WORLD.rooms, point, point))
        assert value == (100 if {"supply room", "printer room 2"} & {*names} else 0), point


@pytest.mark.parametrize(
    "formula",
    [
        'not tr.Exists(goto("printer room 2"))',
        'not tr.AtLeast(inside("printer room 2"), 2)',
        'not tr.Exists(holding("mug", inside("printer room 2")))',
        'not tr.OnlyAfterFirst(say("night")).Exists(inside("printer room 2"))',
        'not tr.Exists(inside("cellar"))',
    ],
)
def test_other_rules_have_no_keepout_mask(formula: str) -> None:
    for one in (rule(formula), replace(NEVER, when="finally")):
        assert keepout_messages([one], WORLD.rooms)[0]["data"] == [0]


def test_violation_names_the_room_and_the_carried_thing() -> None:
    guard = RuleGuard([NEVER], MAP)
    guard.record_drive((2, 3), (4.5, 3), "")
    with pytest.raises(RuleViolationError) as caught:
        guard.record_drive((4.5, 3), (7, 3), "mug")
    assert caught.value.event == Event("inside", "printer room 2")
    assert caught.value.event is not None
    assert caught.value.event.holding == "mug"
    assert caught.value.is_late
