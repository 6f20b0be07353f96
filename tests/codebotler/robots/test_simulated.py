"""The simulated robot drives at walking pace, reports its position, and stops at any moment."""

import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.world import Person, Room, World
from codebotler.robots.base import CameraPicture, CancelledError, Options, Robot
from codebotler.robots.open import list_readiness, open_robot
from codebotler.robots.ros.kinds import INSTALL_ROS1, find_fix
from codebotler.robots.simulated import METRES_PER_SECOND, Simulated

WORLD = World(
    (
        Room("hall", footprint=((0, 0), (2, 0), (2, 2), (0, 2)), stand_at=(1.0, 1.0)),
        Room("kitchen", ("mug",), (Person("ann", ("yes",)),), ((4, 0), (8, 0), (8, 6), (4, 6)), (4.0, 5.0)),
    ),
    "hall",
)


def connect(speed: float | None = None) -> Simulated:
    robot = Simulated(WORLD, speed=speed)
    robot.connect()
    return robot


def test_driving_time_follows_from_the_distance() -> None:
    robot = connect()
    robot.perform("go_to", ["Kitchen"])
    assert robot.clock.now == pytest.approx(5 / METRES_PER_SECOND)
    assert robot.perform("get_current_location", []) == "kitchen"
    robot.perform("go_to", ["the kitchen"])
    assert robot.clock.now == pytest.approx(5 / METRES_PER_SECOND)


def test_feedback_reports_positions_on_the_way() -> None:
    phrases: list[str | CameraPicture] = []
    connect(speed=10).perform("go_to", ["kitchen"], phrases.append)
    assert phrases[-1] == "at (4.0, 5.0)"
    assert 2 <= len(phrases) <= 8
    texts = [str(text).removeprefix("at (").removesuffix(")") for text in phrases]
    places = [tuple(map(float, text.split(", "))) for text in texts]
    assert places == sorted(places)
    assert all(abs((x - 1) * 4 / 3 - (y - 1)) < 0.2 for x, y in places)


def test_skills_work_as_in_the_simulator() -> None:
    robot = connect()
    robot.perform("go_to", ["kitchen"])
    assert robot.perform("get_all_rooms", []) == ["hall", "kitchen"]
    assert robot.perform("is_in_room", ["mug"]) is True
    assert robot.perform("pick", ["mug"]) is None
    assert robot.perform("is_in_room", ["mug"]) is False, "ann answers to her own name only"
    assert robot.perform("is_in_room", ["somebody"]) is True
    assert robot.perform("ask", ["ann", "Tea?", ("No", "Yes")]) == "Yes"
    assert robot.perform("ask", ["ann", "Yes?", ("Yes", "No")]) == "Yes"


@pytest.mark.parametrize(
    ("skill", "arguments", "kind"),
    [
        ("go_to", ["cellar"], "GoToInvalidLocation"),
        ("pick", ["mug"], "PickInvalidObject"),
        ("place", ["mug"], "PlaceNoObject"),
        ("ask", ["ann", "Tea?", ("Yes",)], "AskNoPerson"),
    ],
)
def test_errors_are_those_of_the_simulator(skill: str, arguments: list[str], kind: str) -> None:
    with pytest.raises(RobotError) as error:
        connect().perform(skill, arguments)
    assert error.value.kind == kind


def test_cancel_ends_a_drive_on_the_way_and_all_that_comes_after() -> None:
    robot = connect(speed=0.01)
    with ThreadPoolExecutor(1) as thread:
        on_the_way = threading.Event()
        driving = thread.submit(robot.perform, "go_to", ["kitchen"], lambda _: on_the_way.set())
        assert on_the_way.wait(30)
        began = time.monotonic()
        robot.cancel()
        with pytest.raises(CancelledError):
            driving.result(5)
        assert time.monotonic() - began < 2
    for skill, argument in (("say", "hello"), ("go_to", "kitchen"), ("go_to", "cellar")):
        with pytest.raises(CancelledError):
            robot.perform(skill, [argument])
    with pytest.raises(CancelledError):
        robot.perform("get_current_location", [])
    robot.connect()
    assert robot.perform("get_current_location", []) == "hall"


def test_cancel_before_any_skill_still_counts() -> None:
    robot = connect()
    robot.cancel()
    with pytest.raises(CancelledError):
        robot.perform("say", ["hello"])


def test_connecting_again_resets_the_world() -> None:
    robot = connect()
    robot.perform("go_to", ["kitchen"])
    robot.perform("pick", ["mug"])
    robot.disconnect()
    robot.disconnect()
    robot.connect()
    robot.perform("go_to", ["kitchen"])
    robot.perform("pick", ["mug"])


def test_simulated_robot_is_opened_by_name_and_needs_a_world() -> None:
    robot: Robot = open_robot("sim", Options(world=WORLD, speed=3))
    assert (robot.name, robot.clock.speed) == ("simulated", 3)
    with pytest.raises(UserError, match="--world FILE"):
        open_robot("sim")
    with pytest.raises(UserError, match=r'"simm".* sim, pyrobosim, ros1, rosbridge, ros2'):
        open_robot("simm")


def test_every_kind_of_robot_is_listed_with_missing_requirements() -> None:
    kinds = {kind.name: kind for kind in list_readiness()}
    assert list(kinds) == ["sim", "pyrobosim", "ros1", "rosbridge", "ros2"]
    assert kinds["sim"].works
    assert all(kind.works or kind.missing for kind in kinds.values())


@pytest.mark.parametrize("python", [Path(sys.executable), Path("/no/such/python")])
def test_robots_on_ros_are_checked_with_the_given_python(python: Path) -> None:
    kinds = {kind.name: kind for kind in list_readiness(python)}
    for name in ("ros1", "ros2"):
        assert not kinds[name].works
        assert kinds[name].missing.startswith(str(python))


def test_each_fix_is_a_command(tmp_path: Path) -> None:
    mends = [
        kind.mend for path in (sys.executable, "/no", "/bin/false") for kind in list_readiness(Path(path))
    ]
    mends += [
        INSTALL_ROS1,
        find_fix(),
        find_fix(tmp_path),
    ]
    for version in ("humble", "noetic"):
        (tmp_path / version / "share").mkdir(parents=True)
        (tmp_path / version / "setup.bash").touch()
    (tmp_path / "humble" / "share" / "rclpy").mkdir()
    assert find_fix(tmp_path) == f"source {tmp_path}/humble/setup.bash"
    for mend in filter(None, mends):
        assert mend.split()[0] in {"apt-get", "cd", "codebotler", "pip", "python3", "source"}
        subprocess.run(["bash", "-n", "-c", mend], check=True)
