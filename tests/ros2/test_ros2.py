"""The robot on ROS 2, against a stand-in for rclpy: no ROS 2 graph was at hand."""

from __future__ import annotations

import ast
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.robots.base import CancelledError, NotReadyError, Options, Picture, RobotLostError
from codebotler.robots.open import open_robot
from codebotler.robots.ros import ros2
from codebotler.robots.ros.robot import RosRobot, Waits
from codebotler.robots.ros.ros2 import NOTE, readiness
from codebotler.robots.ros.worker import WORKERS

STUB = Path(__file__).parent / "stub"
WAITS = Waits(patience=1.0, silence=0.5, longest=20.0)


@pytest.fixture(autouse=True)
def notes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "notes"
    path.touch()
    monkeypatch.setenv("NOTES", str(path))
    monkeypatch.setenv("PYTHONPATH", str(STUB))
    return path


@pytest.fixture
def robot() -> Iterator[RosRobot]:
    robot = ros2.robot(Options(ros_python=Path(sys.executable)), WAITS)
    robot.connect()
    yield robot
    robot.disconnect()


def until(noted: Callable[[], bool]) -> None:
    ends = time.monotonic() + 60
    while not noted():
        assert time.monotonic() < ends
        time.sleep(0.01)


def stopped(robot: RosRobot, notes: Path, goal: str) -> BaseException | None:
    """What a goal ends with that is cancelled once it is sent."""
    ended: list[BaseException] = []

    def run() -> None:
        try:
            robot.perform("go_to", [goal])
        except (CancelledError, RobotLostError) as error:
            ended.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    until(lambda: f"goal {goal}\n" in notes.read_text())
    robot.cancel()
    thread.join()
    return ended[0] if ended else None


def test_goal_is_executed_and_the_result_comes_back(robot: RosRobot, notes: Path) -> None:
    told: list[str | Picture] = []
    assert robot.missing == {}
    assert robot.perform("go_to", ["feedback"], told.append) is None
    assert told == ["near: the hall"]
    assert robot.perform("get_current_location", []) == "hall"
    assert robot.perform("get_all_rooms", []) == ["hall", "lab"]
    assert robot.perform("is_in_room", ["mug"]) is True
    assert robot.perform("ask", ["ann", "tea?", ("yes", "no")]) == "yes"
    assert "goal ann tea? ['yes', 'no']\n" in notes.read_text()


@pytest.mark.parametrize("state", ["abort", "reject"])
def test_rejected_or_aborted_goal_is_a_robot_error(robot: RosRobot, state: str) -> None:
    with pytest.raises(RobotError) as error:
        robot.perform("go_to", [state])
    assert error.value.kind == "GoToInvalidLocation"
    assert f"/go_to_server {state}ed " in str(error.value)


def test_cancel_reaches_the_server(robot: RosRobot, notes: Path) -> None:
    assert isinstance(stopped(robot, notes, "never"), CancelledError)
    assert "cancel never\n" in notes.read_text()


def test_cancel_before_the_server_has_taken_the_goal(robot: RosRobot, notes: Path) -> None:
    assert isinstance(stopped(robot, notes, "slow"), CancelledError)
    assert "cancel never\n" in notes.read_text()


def test_goal_that_somebody_else_cancels_is_cancelled(robot: RosRobot) -> None:
    with pytest.raises(CancelledError):
        robot.perform("go_to", ["by somebody else"])


def test_robot_that_does_not_stop_is_said_not_to(robot: RosRobot, notes: Path) -> None:
    error = stopped(robot, notes, "never, whatever you say")
    assert isinstance(error, RobotLostError)
    assert re.search(r"told to stop.* 1 s", error.sentence)


def test_server_that_dies_or_takes_no_notice(robot: RosRobot) -> None:
    with pytest.raises(RobotLostError, match=r"accept the goal .*1 s"):
        robot.perform("say", ["ignore"])
    with pytest.raises(RobotLostError, match=r"/go_to_server has died.* 0\.5 s"):
        robot.perform("go_to", ["die"])


def test_missing_server_and_second_tool(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LACKS", "/pick_server")
    robot = ros2.robot(Options(ros_python=Path(sys.executable)), WAITS)
    robot.connect()
    assert set(robot.missing) == {"pick"}
    assert "robot_actions_pkg/action/Pick" in robot.missing["pick"]
    robot.disconnect()
    monkeypatch.setenv("NODES", "camera codebotler")
    with pytest.raises(NotReadyError, match="node codebotler"):
        robot.connect()


def test_killed_worker_is_replaced_by_one_that_cancels_all(robot: RosRobot, notes: Path) -> None:
    def kill() -> None:
        until(lambda: "goal never\n" in notes.read_text())
        assert robot._worker is not None
        os.kill(robot._worker._process.pid, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(RobotLostError, match="cancelled all goals"):
        robot.perform("go_to", ["never"])
    killer.join()
    assert notes.read_text().count("cancel all /") == len(SKILLS)


def test_it_is_said_how_far_it_was_tested() -> None:
    assert readiness(Path(sys.executable)).note == NOTE == readiness(Path("/nowhere")).note
    assert "never on a ROS 2 graph" in NOTE


def test_address_is_a_domain() -> None:
    assert open_robot("ros2", Options(address="7")).address == "7"
    with pytest.raises(UserError, match=r'"robot" .*ROS_DOMAIN_ID'):
        open_robot("ros2", Options(address="robot"))


def test_worker_is_read_by_python_3_8() -> None:
    ast.parse((WORKERS / "ros2_worker.py").read_text(), feature_version=(3, 8))
