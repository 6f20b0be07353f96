"""The robot in pyrobosim drives around walls, carries objects, and ends with the simulator's traces."""

from __future__ import annotations

import itertools
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from codebotler.checking.check import check
from codebotler.core.errors import RobotError
from codebotler.core.skills.declaration import POSE_IN_ROOM
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Event
from codebotler.core.world import Person, Point, Room, World
from codebotler.core.world_file import read_world
from codebotler.missions.live import LiveRobot
from codebotler.missions.mission import Mission
from codebotler.missions.preflight import ask_rooms
from codebotler.missions.storage.log import MissionState
from codebotler.models.recorded import open_recorded
from codebotler.robots.base import CameraPicture, CancelledError, NotReadyError
from codebotler.robots.open import list_readiness
from codebotler.robots.pyrobosim.robot import Pyrobosim
from codebotler.robots.reservation import Reservation
from codebotler.robots.simulated import FEEDBACK_SECONDS, METRES_PER_SECOND, OFFICE, SIMULATION
from codebotler.rtl import parse
from codebotler.simulator.engine import run
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.worker import Worker
from roboeval.suites.load import Suite

REASON = "pyrobosim is not installed; `make test-pyrobosim` has it"
pytest.importorskip("pyrobosim", reason=REASON)
LineString = pytest.importorskip("shapely.geometry", reason=REASON).LineString

WORLD = World(
    (
        Room("hall"),
        Room("kitchen", ("cup", "mug", "mug"), (Person("ann", ("yes",)),)),
        Room("study"),
        Room("lab", (r"laser\b",)),
    ),
    "hall",
)
L_SHAPED: tuple[Point, ...] = ((0, 0), (4, 0), (4, 2), (2, 2), (2, 4), (0, 4))
SMALL: tuple[Point, ...] = ((5, 0), (5.7, 0), (5.7, 0.7), (5, 0.7))
MEASURED = World(
    (
        Room("hall", footprint=L_SHAPED, stand_at=(3.0, 1.0)),
        Room("kitchen", ("mug",), footprint=((2, 2), (4, 2), (4, 4), (2, 4)), stand_at=(4.0, 4.0)),
        Room("shed", footprint=((8, 0), (10, 0), (10, 4), (8, 4))),
    ),
    "hall",
)


def connect(world: World = WORLD, speed: float | None = None) -> Pyrobosim:
    robot = Pyrobosim(world, speed=speed)
    robot.connect()
    return robot


def places(phrases: Sequence[str | CameraPicture]) -> list[Point]:
    read = (str(phrase).removeprefix("at (").removesuffix(")").split(", ") for phrase in phrases)
    return [(float(x), float(y)) for x, y in read]


def position(robot: Pyrobosim) -> Point:
    assert robot._drivable is not None
    pose = robot._drivable.robot.get_pose()
    return pose.x, pose.y


def layout(robot: Pyrobosim) -> dict[str, list[str]]:
    """Return the objects in each room."""
    contents = robot._robot.contents
    return {name: [thing.label for thing in things] for name, things in contents.items() if things}


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    worker = Worker()
    yield worker
    worker.close()


# --- agreement with the simulator


def test_reference_programs_leave_the_simulators_traces(paper: Suite, worker: Worker) -> None:
    model = open_recorded("recorded:careful")
    tasks = [
        (task.name, model.solution(task.prompts[0], 0).program, scenario.world)
        for task in paper.tasks.values()
        for scenario in task.scenarios
        if not scenario.world.may_wait_forever
    ]
    pairs = [(program, world) for _, program, world in tasks]
    expected = list(run(pairs, workers=1, settings=SIMULATION))
    manipulating = set()
    for (name, program, world), outcome in zip(tasks, expected, strict=True):
        robot = LiveRobot(connect(world), lambda *_, **__: None, clock_starts=SIMULATION.clock_starts)
        found = worker.run_live(program, robot)
        assert (found.status, found.error) == (outcome.status, outcome.error), name
        assert found.trace == outcome.trace, name
        manipulating |= (
            {name} if {"goto", "pick", "place"} <= {event.kind for event in found.trace} else set()
        )
    assert len({name for name, _, _ in tasks}) == 16
    assert {"GetDrink", "MailDelivery", "StaplerDelivery"} <= manipulating


@pytest.mark.parametrize(
    ("room", "calls", "kind"),
    [
        ("hall", [("go_to", "cellar")], "GoToInvalidLocation"),
        ("hall", [("pick", "mug")], "PickInvalidObject"),
        ("kitchen", [("pick", "kettle")], "PickInvalidObject"),
        ("kitchen", [("pick", "mug"), ("pick", "cup")], "PickWhileHolding"),
        ("kitchen", [("place", "mug")], "PlaceNoObject"),
        ("kitchen", [("pick", "the mug"), ("place", "mug")], "PlaceNoObject"),
        ("hall", [("ask", "ann", "Tea?", ("Yes",))], "AskNoPerson"),
        ("kitchen", [("ask", "ann", "Tea?", ())], "AskEmptyOptions"),
        ("kitchen", [("ask", "ann", "Tea?", ("Never",))], "AskInvalidOptions"),
    ],
)
def test_errors_are_those_of_the_simulator(room: str, calls: list[tuple[str, ...]], kind: str) -> None:
    robot = connect()
    robot.perform("go_to", [room])
    *before, (skill, *arguments) = calls
    for earlier, *given in before:
        robot.perform(earlier, given)
    at = position(robot)
    with pytest.raises(RobotError) as error:
        robot.perform(skill, arguments)
    assert error.value.kind == kind
    assert position(robot) == at


def test_people_answer_as_the_world_file_says() -> None:
    robot = connect()
    assert robot.perform("get_all_rooms", []) == ["hall", "kitchen", "study", "lab"]
    assert robot.perform("is_in_room", ["ann"]) is False
    robot.perform("go_to", ["Kitchen"])
    assert robot.perform("get_current_location", []) == "kitchen"
    assert robot.perform("is_in_room", ["ann"]) is True
    assert robot.perform("ask", ["ann", "Tea?", ("No", "Yes")]) == "Yes"
    assert robot.perform("say", ["hello"]) is None


# --- objects


def test_objects_lie_where_they_were_put() -> None:
    robot = connect()
    assert layout(robot) == {"kitchen": ["cup", "mug", "mug"], "lab": [r"laser\b"]}
    robot.perform("go_to", ["kitchen"])
    robot.perform("pick", ["the mug"])
    assert layout(robot)["kitchen"] == ["cup", "mug"]
    robot.perform("go_to", ["study"])
    assert robot.perform("is_in_room", ["mug"]) is False
    robot.perform("place", ["the mug"])
    assert robot.perform("is_in_room", ["go and get the mug"]) is True
    robot.perform("go_to", ["lab"])
    robot.perform("pick", ["laser"])
    robot.perform("place", ["laser"])
    assert layout(robot) == {"kitchen": ["cup", "mug"], "study": ["mug"], "lab": [r"laser\b"]}
    robot.perform("pick", ["laser"])


def test_resumed_robot_is_where_it_was_and_holds_what_it_held() -> None:
    robot = connect()
    robot.resume((Event("goto", "kitchen"), Event("pick", "mug", place="kitchen")))
    assert robot.perform("get_current_location", []) == "kitchen"
    assert layout(robot)["kitchen"] == ["cup", "mug"]
    robot.perform("place", ["mug"])


def test_robot_drives_to_the_table_to_pick() -> None:
    robot, phrases = connect(), list[str | CameraPicture]()
    robot.perform("go_to", ["kitchen"])
    robot.perform("pick", ["mug"], phrases.append)
    assert len(phrases) >= 2
    assert robot.perform("get_current_location", []) == "kitchen"
    robot.perform("go_to", ["kitchen"], phrases.append)
    assert phrases[-1] == phrases[0]


def test_state_comes_from_pyrobosim() -> None:
    robot = connect()
    robot.perform("go_to", ["lab"])
    stage = robot._drivable
    assert stage is not None
    stage.robot.battery_level = 0.0
    with pytest.raises(RobotError, match=r'"laser".*Out of battery') as error:
        robot.perform("pick", ["laser"])
    assert error.value.kind == "PickFailed"
    assert robot.perform("is_in_room", ["laser"]) is True, "it was not taken"
    stage.robot.battery_level = 100.0
    robot.perform("pick", ["laser"])
    stage.put_robot("study")
    assert robot.perform("get_current_location", []) == "study"


def test_many_objects_find_a_place() -> None:
    footprint: tuple[Point, ...] = ((0, 0), (1.5, 0), (1.5, 1.5), (0, 1.5))
    crowd = tuple(f"thing {number}" for number in range(60))
    robot = connect(World((Room("store", crowd, (), footprint), Room("hall")), "store"))
    for thing in crowd:
        robot.perform("pick", [thing])
        robot.perform("go_to", ["hall"])
        robot.perform("place", [thing])
        robot.perform("go_to", ["store"])
    assert layout(robot) == {"hall": list(crowd)}


# --- routes


def is_free_of_walls(robot: Pyrobosim, way: Sequence[Point]) -> bool:
    assert robot._drivable is not None
    return bool(robot._drivable._world.total_internal_polygon.buffer(0.1).covers(LineString(way)))


def test_robot_drives_around_walls_at_walking_pace() -> None:
    robot, phrases = connect(), list[str | CameraPicture]()
    start = position(robot)
    robot.perform("go_to", ["study"], phrases.append)
    way = [start, *places(phrases)]
    assert way[-1] == pytest.approx(position(robot), abs=0.05)
    assert is_free_of_walls(robot, way)
    assert not is_free_of_walls(robot, [way[0], way[-1]])
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(way))
    assert length / METRES_PER_SECOND - 1 < robot.clock.now < 2 * length / METRES_PER_SECOND
    now = robot.clock.now
    robot.perform("say", ["hello"])
    assert robot.clock.now == now + SKILLS["say"].seconds


def test_feedback_reports_positions_on_the_way() -> None:
    robot, phrases = connect(speed=10), list[str | CameraPicture]()
    began = time.monotonic()
    robot.perform("go_to", ["study"], phrases.append)
    assert len(phrases) <= 2 + (time.monotonic() - began) / FEEDBACK_SECONDS
    assert len(places(phrases)) >= 3
    assert robot.clock.now == pytest.approx(10 * (time.monotonic() - began), rel=0.5)


def test_rooms_with_footprints_keep_their_places_and_can_be_reached() -> None:
    robot, phrases = connect(MEASURED), list[str | CameraPicture]()
    assert position(robot) == pytest.approx((3.0, 1.0))
    for room, corner in (("kitchen", (4.0, 4.0)), ("shed", (9.0, 2.0)), ("hall", (3.0, 1.0))):
        robot.perform("go_to", [room], phrases.append)
        assert robot.perform("get_current_location", []) == room
        assert math.dist(position(robot), corner) < 0.5, "near the corner, but not in the wall"
    assert is_free_of_walls(robot, [(3.0, 1.0), *places(phrases)])


def test_closed_door_is_an_error_and_nothing_has_moved() -> None:
    robot = connect()
    at, stage = position(robot), robot._drivable
    assert stage is not None
    for hallway in stage._world.hallways:
        stage._world.close_location(hallway)
    stage.robot.reset_path_planner()
    with pytest.raises(RobotError) as error:
        robot.perform("go_to", ["kitchen"])
    assert error.value.kind == "GoToInvalidLocation"
    assert '"kitchen"' in str(error.value)
    assert "Failed to plan a path." in str(error.value)
    assert (position(robot), robot.perform("get_current_location", [])) == (at, "hall")


@pytest.mark.parametrize(
    ("room", "named"),
    [
        (Room("b", footprint=((1, 1), (5, 1), (5, 5), (1, 5))), '"a" and "b" overlap'),
        (Room("b", footprint=((5, 0), (9, 0), (9, 0.5), (5, 0.5))), '"b" is too narrow'),
        (Room("b", footprint=((5, 0), (9, 4), (9, 0), (5, 4))), "crossing edges"),
        (Room("b", ("mug",), footprint=SMALL), 'no table .*"b"'),
    ],
)
def test_impossible_rooms_are_refused(room: Room, named: str) -> None:
    first = Room("a", footprint=((0, 0), (4, 0), (4, 4), (0, 4)))
    robot = Pyrobosim(World((first, room), "a"))
    with pytest.raises(NotReadyError, match=named):
        robot.connect()
    robot.disconnect()


def test_nothing_can_be_put_down_if_no_table_has_room() -> None:
    first = Room("a", ("mug",), footprint=((0, 0), (4, 0), (4, 4), (0, 4)))
    robot = connect(World((first, Room("b", footprint=SMALL)), "a"))
    robot.perform("pick", ["mug"])
    robot.perform("go_to", ["b"])
    with pytest.raises(RobotError, match=r'no table .*"b"') as error:
        robot.perform("place", ["mug"])
    assert error.value.kind == "PlaceFailed"
    robot.perform("go_to", ["a"])
    robot.perform("place", ["mug"])


PLAN = """
import json, sys, threading
seen = []
watched = ("socket.", "subprocess.", "os.posix_spawn", "webbrowser.")
sys.addaudithook(lambda event, _: event.startswith(watched) and seen.append(event))
import numpy
before = numpy.random.get_state()[1].tolist()
from codebotler.robots.pyrobosim.robot import Pyrobosim
from codebotler.core.world import World
from codebotler.core.world_file import read_world
from pathlib import Path
robot = Pyrobosim(read_world(Path(sys.argv[1])), speed=None)
robot.connect()
ways = []
for skill, argument in (("go_to", "kitchen"), ("pick", "mug"), ("go_to", "study"), ("place", "mug")):
    robot.perform(skill, [argument], ways.append)
print(json.dumps({
    "ways": [ways, robot.clock.now],
    "quiet": [seen, threading.active_count(), [name for name in ("dash", "flask") if name in sys.modules]],
    "dice": before == numpy.random.get_state()[1].tolist(),
}))
"""


def test_same_world_gives_the_same_routes_without_side_effects(tmp_path: Path) -> None:
    world = tmp_path / "world.yaml"
    world.write_text(WORLD.to_yaml())
    found = []
    for seed in ("1", "2"):
        command = [sys.executable, "-W", "error", "-c", PLAN, str(world)]
        environment = {**os.environ, "PYTHONHASHSEED": seed}
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
        assert not done.stderr, "pyrobosim must not log to the terminal"
        found.append(json.loads(done.stdout))
    assert found[0] == found[1]
    assert found[0]["quiet"] == [[], 1, []]
    assert found[0]["dice"], "the state of numpy's random numbers must not change"


# --- stop


@pytest.mark.parametrize("held", [False, True])
def test_cancel_ends_a_drive_on_the_way_and_all_that_comes_after(*, held: bool) -> None:
    robot = connect(speed=1)
    if held:
        robot.clock.speed = None
        robot.perform("go_to", ["lab"])
        robot.perform("pick", ["laser"])
        robot.clock.speed = 1
    on_the_way = threading.Event()
    with ThreadPoolExecutor(1) as thread:
        driving = thread.submit(robot.perform, "go_to", ["kitchen"], lambda _: on_the_way.set())
        assert on_the_way.wait(30)
        assert not driving.done()
        began = time.monotonic()
        robot.cancel()
        with pytest.raises(CancelledError):
            driving.result(5)
        assert time.monotonic() - began < 2
    stands = position(robot)
    for skill, argument in (("say", "hello"), ("go_to", "kitchen"), ("go_to", "cellar"), ("pick", "mug")):
        with pytest.raises(CancelledError):
            robot.perform(skill, [argument])
    with pytest.raises(CancelledError):
        robot.perform("get_current_location", [])
    time.sleep(0.3)
    assert position(robot) == stands
    robot.connect()
    assert robot.perform("get_current_location", []) == "hall"
    assert layout(robot) == {"kitchen": ["cup", "mug", "mug"], "lab": [r"laser\b"]}
    robot.clock.speed = None
    robot.perform("go_to", ["kitchen"])
    robot.disconnect()
    robot.disconnect()


def test_cancel_during_planning_still_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, phrases = connect(), list[str | CameraPicture]()
    at, stage = position(robot), robot._drivable
    assert stage is not None
    plan = stage.robot.plan_path

    def cancel_meanwhile(*arguments: object) -> object:
        robot.cancel()
        return plan(*arguments)

    monkeypatch.setattr(stage.robot, "plan_path", cancel_meanwhile)
    with pytest.raises(CancelledError):
        robot.perform("go_to", ["kitchen"], phrases.append)
    assert (position(robot), phrases) == (at, [])


def test_cancel_before_the_hand_has_closed_leaves_the_object(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = connect()
    robot.perform("go_to", ["kitchen"])
    wait = robot.clock.wait

    def cancel_meanwhile(seconds: float) -> bool:
        if seconds == SKILLS["pick"].seconds:
            robot.cancel()
        return wait(seconds)

    monkeypatch.setattr(robot.clock, "wait", cancel_meanwhile)
    with pytest.raises(CancelledError):
        robot.perform("pick", ["mug"])
    assert layout(robot)["kitchen"] == ["cup", "mug", "mug"]
    assert robot._robot.held is None


def test_cancel_before_any_skill_still_counts() -> None:
    robot = connect()
    robot.cancel()
    with pytest.raises(CancelledError):
        robot.perform("say", ["hello"])


def test_second_tool_is_refused(tmp_path: Path) -> None:
    with (
        Reservation(Pyrobosim(WORLD), tmp_path),
        pytest.raises(NotReadyError, match="robot pyrobosim"),
        Reservation(Pyrobosim(WORLD), tmp_path),
    ):
        pass


# --- the command


PROGRAM = """def task_program():
    go_to("kitchen")
    pick("cup")
    go_to("study")
    place("cup")
"""


def test_command_runs_a_program_and_ctrl_c_stops_it(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text(WORLD.to_yaml())
    (tmp_path / "program.py").write_text(PROGRAM)
    command = [sys.executable, "-m", "codebotler", "run", "program.py", "--robot", "pyrobosim", "--yes"]
    command += ["--world", "world.yaml", "--speed"]
    environment = {**os.environ, "CODEBOTLER_HOME": str(tmp_path / "home"), "NO_COLOR": "1"}
    done = subprocess.run(
        [*command, "0"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    errors = done.stderr.removeprefix("connecting the robot ...\n")  # Only a slow start prints it.
    assert (done.returncode, errors) == (0, "")
    assert "robot pyrobosim" in done.stdout
    assert 'puts down "cup"' in done.stdout
    with subprocess.Popen(
        [*command, "1"], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout is not None
        assert any("at (" in line for line in running.stdout)
        running.send_signal(signal.SIGINT)
        rest, _ = running.communicate(timeout=30)
    assert running.returncode == 130
    assert "stopped" in rest


def test_command_keeps_a_house_rule(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text(WORLD.to_yaml())
    (tmp_path / "program.py").write_text(PROGRAM)
    always = """'not tr.Exists(holding("cup", goto("study")))'"""
    rule = f"{{name: study, says: No cup goes into the study., always: {always}}}"
    (tmp_path / "house.yaml").write_text(f"rules: [{rule}]")
    command = [sys.executable, "-m", "codebotler", "run", "program.py", "--robot", "pyrobosim", "--yes"]
    command += ["--world", "world.yaml", "--speed", "0", "--rules", "house.yaml", "--despite-problems"]
    environment = {**os.environ, "CODEBOTLER_HOME": str(tmp_path / "home"), "NO_COLOR": "1"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert "stopped by rule study" in done.stdout, done.stderr
    assert "picks up" in done.stdout
    assert "puts down" not in done.stdout


def test_pyrobosim_is_listed_as_working() -> None:
    (kind,) = (kind for kind in list_readiness() if kind.name == "pyrobosim")
    assert kind.works


def test_rooms_are_regexes_for_the_check_as_in_its_world() -> None:
    plan, place = ask_rooms(connect(World((Room("hall"), Room("kitchen|cafe")), "hall")), print)
    assert plan is not None
    assert (plan.room("the cafe"), place) == ("kitchen|cafe", "hall")


@pytest.mark.parametrize(("room", "is_stopped"), [("printer room 2", False), ("printer room 3", True)])
def test_rules_about_its_position_hold_along_its_own_route(
    tmp_path: Path, room: str, *, is_stopped: bool
) -> None:
    world = read_world(OFFICE)
    robot = Pyrobosim(world, speed=None)
    formula = parse(f'not tr.Exists(inside("{room}"))', skills=SKILLS.with_skill(POSE_IN_ROOM))
    mission = Mission(tmp_path, robot.name)
    mission.set_program("def task_program():\n    go_to('printer room 1')\n    go_to('printer room 3')\n")
    mission.record_check([])
    mission.approve()
    with Reservation(robot, tmp_path) as reserved, mission:
        room_map, place = ask_rooms(robot, mission.note, world)
        rules = [Rule("never", "Never be there.", formula)]
        assert not check(mission.summary.program, room_map=room_map, house_rules=rules).problems or is_stopped
        mission.run(reserved, place, rules=rules, room_map=room_map)
    assert mission.state is (MissionState.STOPPED if is_stopped else MissionState.DONE)
