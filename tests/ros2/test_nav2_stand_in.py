"""The stand-in for Nav2 follows Nav2's documentation, as a client in plain rclpy sees."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from typing import Any

import pytest

from codebotler.robots.ros.worker import WORKERS_FOLDER
from ros2_scene import HERE, ROS2_PYTHON
from ros_graph import Process

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
QUICK = ("--speed", "3", "--acceleration", "8", "--recoveries", "2", "--patience", "0.5")


class Nav2:
    """The stand-in and its client."""

    def __init__(self, *options: str) -> None:
        arguments = (str(WORKERS_FOLDER), *QUICK, *options)
        self.robot = Process(HERE / "nav2_stand_in.py", *arguments, python=ROS2_PYTHON)
        self.client = Process(HERE / "nav2_client.py", str(WORKERS_FOLDER), python=ROS2_PYTHON)

    def do(self, *what: object) -> None:
        write(self.client, json.dumps(what))

    def result(self, name: str) -> list[Any]:
        """Return the status, code, message, speed and time of a goal's end."""
        return wait_for(self.client, "result", name)

    def go(self, x: float, y: float, *more: object) -> list[Any]:
        self.do("send", "goal", x, y, *more)
        return self.result("goal")[:3]

    def look(self) -> dict[str, Any]:
        self.do("look")
        seen: dict[str, Any] = wait_for(self.client, "seen")[0]
        return seen

    def is_still(self) -> bool:
        self.look()
        time.sleep(0.3)
        seen = self.look()
        return bool(seen["speeds"]) and seen["poses"] == [] and not any(speed for _, speed in seen["speeds"])

    def end(self) -> None:
        self.client.end()
        with suppress(BrokenPipeError):  # It may have died.
            self.robot.end()


def write(process: Process, line: str) -> None:
    assert process.process.stdin is not None
    process.process.stdin.write(line + "\n")
    process.process.stdin.flush()


def wait_for(process: Process, *what: object) -> list[Any]:
    """Wait for the next event that begins with these values; return its rest."""
    while True:
        line = process.events.get(timeout=10)
        if line[: len(what)] == list(what):
            return line[len(what) :]


@pytest.fixture
def nav2() -> Iterator[Callable[..., Nav2]]:
    made: list[Nav2] = []

    def make(*options: str) -> Nav2:
        made.append(Nav2(*options))
        wait_for(made[-1].client, "ready")
        return made[-1]

    yield make
    for each in made:
        each.end()


def test_drive_is_seen_in_feedback_odometry_poses_and_frames(nav2: Callable[..., Nav2]) -> None:
    robot = nav2("--start=1,0,1.57")
    assert robot.go(1, 3, 1.57) == [SUCCEEDED, 0, ""]
    time.sleep(0.4)  # It may still roll.
    assert robot.is_still()
    robot.go(1, 0, 0)
    time.sleep(0.4)
    seen = robot.look()
    left = [each["distance_remaining"] for each in seen["feedback"]]
    drives = seen["feedback"][-1]["navigation_time"]
    assert left == sorted(left, reverse=True)
    assert len(left) > 20 * (drives["sec"] + drives["nanosec"] / 1e9)  # An idle machine sends 100 a second.
    assert any(each["estimated_time_remaining"]["nanosec"] for each in seen["feedback"])
    assert 1.5 < max(speed for _, speed in seen["speeds"]) < 3.01
    assert all(abs(b[1] - a[1]) <= 8 * (b[0] - a[0] + 0.2) for a, b in pairwise(seen["speeds"]))
    assert 5 < len(seen["poses"]) < 30  # One pose for 0.25 m or 0.2 rad.
    assert seen["feedback"][0]["current_pose"]["header"]["frame_id"] == "map"
    outer, inner = (each["transform"] for each in seen["frames"])
    assert (outer["translation"]["x"], outer["translation"]["y"]) == (1, 0)
    assert abs(inner["translation"]["x"]) < 0.4  # Odometry starts at the robot's start.


def test_new_goal_preempts_the_old_one_which_is_aborted_without_a_message(nav2: Callable[..., Nav2]) -> None:
    robot = nav2()
    robot.do("send", "first", 8, 0)
    wait_for(robot.client, "accepted", "first")
    time.sleep(0.4)
    robot.do("send", "second", 3, 1)
    status, code, text, speed, _ = robot.result("first")
    assert (status, code, text) == (ABORTED, 0, "")
    assert speed > 1
    robot.do("send", "with a tree", 0, 0, 0, "map", "own.xml")
    assert robot.result("with a tree")[:2] == [ABORTED, 0]
    assert robot.result("second")[0] == SUCCEEDED


def test_cancelled_goal_ends_at_once_while_the_robot_brakes(nav2: Callable[..., Nav2]) -> None:
    robot = nav2()
    robot.do("send", "goal", 8, 0)
    wait_for(robot.client, "accepted", "goal")
    time.sleep(0.4)
    robot.do("cancel", "goal")
    goals, asked = wait_for(robot.client, "cancelling")
    status, _, _, speed, ended = robot.result("goal")
    assert (status, goals) == (CANCELED, 1)
    assert ended - asked < 0.5
    assert speed > 1
    time.sleep(0.5)
    assert robot.is_still()


def test_planner_says_why_it_fails(nav2: Callable[..., Nav2]) -> None:
    walls = [f"--obstacle={area}" for area in ("2,2,5,2.4", "2,4.6,5,5", "2,2,2.4,5", "4.6,2,5,5")]
    robot = nav2("--map=-6,-6,6,6", "--start=-2,-2,0", "--obstacle=-4,-4,-3,-3", *walls)
    assert robot.go(9, 0)[:2] == [ABORTED, 204]
    status, code, text = robot.go(-3.5, -3.5)
    assert (status, code, bool(text)) == (ABORTED, 206, True)
    assert robot.look()["feedback"][-1:] == []
    assert robot.go(3.5, 3.5)[:2] == [ABORTED, 208]
    wait_for(robot.robot, "recovery", 2)
    assert robot.look()["feedback"][-1]["number_of_recoveries"] == 2
    assert robot.go(1, 0, 0, "kitchen")[:2] == [ABORTED, 9002]
    assert robot.go(1, 0, 0, "map", "own.xml")[:2] == [ABORTED, 9001]
    assert robot.go(-5, -5)[0] == SUCCEEDED
    corner = [pose for pose in robot.look()["poses"] if -4 < pose[0] < -3 and -4 < pose[1] < -3]
    assert corner == []


def test_robot_that_makes_no_progress_recovers_and_then_fails(nav2: Callable[..., Nav2]) -> None:
    robot = nav2()
    write(robot.robot, "block")
    wait_for(robot.robot, "block")
    status, code, text = robot.go(3, 0)
    assert (status, code, bool(text)) == (ABORTED, 105, True)
    assert robot.look()["feedback"][-1]["number_of_recoveries"] == 2
    robot.do("send", "again", 3, 0)
    wait_for(robot.robot, "recovery", 1)
    write(robot.robot, "unblock")
    assert robot.result("again")[0] == SUCCEEDED


def test_inactive_server_rejects_goals_and_aborts_the_one_that_goes_on(nav2: Callable[..., Nav2]) -> None:
    robot = nav2("--inactive")
    robot.do("send", "early", 1, 0)
    wait_for(robot.client, "rejected", "early")
    write(robot.robot, "activate")
    wait_for(robot.robot, "activate")
    robot.do("send", "goal", 8, 0)
    wait_for(robot.client, "accepted", "goal")
    write(robot.robot, "deactivate")
    assert robot.result("goal")[:3] == [ABORTED, 0, ""]


def test_robot_drives_around_keepout_zones_and_refuses_goals_in_them(nav2: Callable[..., Nav2]) -> None:
    robot = nav2()
    robot.do("mask", 1, -1, 2, 1)
    wait_for(robot.robot, "mask", 100, 100)
    robot.look()
    assert robot.go(3, 0) == [SUCCEEDED, 0, ""]
    poses = [each["current_pose"]["pose"]["position"] for each in robot.look()["feedback"]]
    assert not [at for at in poses if 1 < at["x"] < 2 and -1 < at["y"] < 1]
    assert max(abs(at["y"]) for at in poses) >= 1
    assert robot.go(1.5, 0)[:2] == [ABORTED, 206]


@pytest.mark.parametrize("fault", ["--slow-cancel=0.8", "--never-stops", "--refuse-cancel"])
def test_faults_of_a_stop(nav2: Callable[..., Nav2], fault: str) -> None:
    robot = nav2(fault)
    robot.do("send", "goal", 5 if "refuse" in fault else 9, 0)
    wait_for(robot.client, "accepted", "goal")
    time.sleep(0.4)
    robot.do("cancel", "goal")
    goals, asked = wait_for(robot.client, "cancelling")
    status, *_, ended = robot.result("goal")
    refuses, waits, drives = "refuse" in fault, "slow" in fault, "never" in fault
    assert (goals, status) == ((0, SUCCEEDED) if refuses else (1, CANCELED))
    assert (ended - asked > 0.7) == (refuses or waits)
    time.sleep(0.5)
    assert robot.is_still() != drives


def test_it_hears_speech_opens_its_door_and_dies(nav2: Callable[..., Nav2]) -> None:
    robot = nav2("--door-jams")
    robot.do("say", "„Tea”, for ann?")
    assert wait_for(robot.robot, "heard") == ["„Tea”, for ann?"]
    robot.do("open")
    success, message = wait_for(robot.client, "door")
    assert (success, bool(message)) == (False, True)
    write(robot.robot, "die")
    assert robot.robot.process.wait(10) == -9
