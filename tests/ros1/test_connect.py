"""A file connects an unchanged robot with move_base, on ROS 1 and behind a rosbridge."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from bridges import bridge, ros_handler
from codebotler.core.errors import RobotError
from codebotler.core.skills.files import skills_from
from codebotler.robots.base import CameraPicture, CancelledError, NotReadyError, Options, RobotLostError
from codebotler.robots.ros import kinds
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.connections.connection_file import read_connection
from codebotler.robots.ros.robot import RosRobot
from ros_graph import HERE, LONG, Graph, Process, run_in_thread

CONNECTION = """\
robot: ros1
places: places.yaml
pose: {topic: /amcl_pose}
velocity: {topic: /odom}
skills:
  go_to: {action: /move_base, type: move_base_msgs/MoveBase, goal: {target_pose: $place}}
  say: {topic: /speech, type: std_msgs/String, message: {data: "Listen: $message"}}
  open_door: {service: /door/open, type: std_srvs/Trigger, success: success}
"""
PLACES = """\
frame: map
places:
  dock: {x: 0, y: 0, polygon: [[-1, -1], [1, -1], [1, 1], [-1, 1]]}
  lab: {x: 2, y: 0, yaw: 1.57}
  moon: {x: 9, y: -9}
  mars: {x: 99, y: 0}
"""
SKILLS = """\
from codebotler import Simulation, skill


@skill
def open_door(sim: Simulation) -> None:
    \"\"\"Open the door.\"\"\"
"""
SAY = "skills: {say: {topic: /speech, type: std_msgs/String, message: {data: $message}}}"
WAITS = Timeouts(silence=1.5, longest=20.0)
BOTH = pytest.mark.parametrize("kind", ["ros1", "rosbridge"])


class Robots:
    """A robot with move_base, and the connections to it."""

    def __init__(self, graph: Graph, folder: Path, end: ExitStack) -> None:
        self.graph, self.folder, self._end = graph, folder, end

    def move_base(self, *options: str) -> Process:
        process = Process(HERE / "move_base_robot.py", *options, master=self.graph.uri)
        self.graph.processes.append(process)
        process.expect("ready")
        return process

    def robot(self, kind: str = "ros1", text: str = CONNECTION) -> RosRobot:
        files = {"robot.yaml": text.replace("robot: ros1", f"robot: {kind}"), "places.yaml": PLACES}
        for name, content in {**files, "door.py": SKILLS}.items():
            (self.folder / name).write_text(content)
        table = skills_from(self.folder / "door.py")
        options: dict[str, Any] = {
            "skills": table,
            "connection": read_connection(self.folder / "robot.yaml", table),
        }
        if kind == "ros1":
            robot: RosRobot = kinds.ros1(Options(address=self.graph.uri, **options), WAITS)
        else:
            double = self._end.enter_context(bridge(ros_handler(self.graph.uri, ())))
            robot = kinds.rosbridge(Options(address=double.address, **options), WAITS)
        self._end.callback(robot.disconnect)
        return robot


@pytest.fixture
def robots(graph: Graph, tmp_path: Path) -> Iterator[Robots]:
    with ExitStack() as end:
        yield Robots(graph, tmp_path, end)


def read_event(process: Process, what: str) -> list[object]:
    """Return the details of the stand-in's next event of a kind."""
    while True:
        kind, *about = process.events.get(timeout=LONG)
        if kind == what:
            return about


@BOTH
def test_skills_are_those_of_the_file(robots: Robots, kind: str) -> None:
    move_base = robots.move_base("--speed", "3", "--acceleration", "9")
    robot = robots.robot(kind)
    robot.connect()
    assert [*robot.skills] == ["get_current_location", "get_all_rooms", "go_to", "say", "open_door"]
    assert robot.missing == {}
    assert robot.perform("get_all_rooms", []) == ["dock", "lab", "moon", "mars"]
    assert robot.perform("get_current_location", []) == "dock"
    reported: list[str | CameraPicture] = []
    robot.perform("go_to", ["Lab"], reported.append)
    assert read_event(move_base, "goal") == [2.0, 0.0, 1.57, "map"]
    assert any(str(one).startswith("at (1.") for one in reported)
    assert robot.perform("get_current_location", [], reported.append) == "lab"
    assert "lab, the nearest" in str(reported[-1])
    robot.perform("say", ["it is open"])
    assert read_event(move_base, "heard") == ["Listen: it is open"]
    robot.perform("open_door", [])
    read_event(move_base, "door")
    assert robot.has_pose


@BOTH
def test_failure_is_a_robot_error_with_the_robots_message(robots: Robots, kind: str) -> None:
    robots.move_base("--door-jams")
    robot = robots.robot(kind)
    robot.connect()
    for skill, arguments, error_kind, words in (
        ("go_to", ["mars"], "GoToFailed", "no plan"),
        ("go_to", ["attic"], "GoToInvalidLocation", "dock, lab"),
        ("open_door", [], "OpenDoorFailed", "jammed"),
    ):
        with pytest.raises(RobotError, match=words) as error:
            robot.perform(skill, arguments)
        assert error.value.kind == error_kind


@BOTH
def test_stop_ends_when_the_robot_stands_still(robots: Robots, kind: str) -> None:
    move_base = robots.move_base("--speed", "2", "--acceleration", "2")
    robot = robots.robot(kind)
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["moon"])) as ended:
        read_event(move_base, "goal")
        time.sleep(1.0)
        asked = time.monotonic()
        robot.cancel()
        read_event(move_base, "cancel")
        assert time.monotonic() - asked < 1.0
    assert isinstance(ended["error"], CancelledError)
    assert robot.failed_stop == ""
    assert 1.0 < time.monotonic() - asked < 4.0  # It brakes for a second.


@BOTH
def test_robot_that_goes_on_after_a_stop_is_lost(robots: Robots, kind: str) -> None:
    move_base = robots.move_base("--never-stops")
    robot = robots.robot(kind)
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["moon"])) as ended:
        read_event(move_base, "goal")
        time.sleep(0.7)
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)
    assert "BY HAND" in robot.failed_stop


@BOTH
def test_service_that_fails_is_an_error(robots: Robots, kind: str) -> None:
    robots.move_base("--door-breaks")
    robot = robots.robot(kind)
    robot.connect()
    with pytest.raises(RobotError, match="no current") as error:
        robot.perform("open_door", [])
    assert error.value.kind == "OpenDoorFailed"


def test_service_that_dies_is_lost(robots: Robots) -> None:
    robots.move_base("--door-dies")
    robot = robots.robot()
    robot.connect()
    with pytest.raises(RobotLostError, match="/door/open"):
        robot.perform("open_door", [])


@BOTH
def test_pose_comes_from_transforms(robots: Robots, kind: str) -> None:
    robots.move_base("--start", "3,4,1.0", "--speed", "2")
    text = CONNECTION.replace("{topic: /amcl_pose}", "{tf: {from: map, to: base_link}}")
    robot = robots.robot(kind, text)
    robot.connect()
    pose = robot._pose()
    assert pose is not None
    assert math.dist((pose.x, pose.y, pose.yaw), (3, 4, 1.0)) < 0.01
    robot.perform("go_to", ["lab"])
    pose = robot._pose()
    assert pose is not None
    assert math.dist((pose.x, pose.y), (2, 0)) < 0.4


@BOTH
def test_poses_that_cannot_be_used_are_refused(robots: Robots, kind: str) -> None:
    robots.move_base()
    for topic, sentence in (("/odom", '"odom".*"map"'), ("/nothing", "/nothing")):
        robot = robots.robot(kind, CONNECTION.replace("/amcl_pose", topic))
        with pytest.raises(NotReadyError, match=sentence):
            robot.connect()
        robot.disconnect()


def test_missing_offers_are_reported(robots: Robots) -> None:
    robots.move_base()
    text = CONNECTION.replace("/move_base,", "/drive,").replace("/door/open", "/gate")
    robot = robots.robot(text=text.replace("/speech", "/voice"))
    with pytest.raises(NotReadyError, match=r"offers no skills.*no action server at /drive"):
        robot.connect()
    robot = robots.robot(text=text.replace("velocity: {topic: /odom}\n", ""))
    robot.connect()
    assert {skill: why.partition(" at ")[0] for skill, why in robot.missing.items()} == {
        "go_to": "there is no action server",
        "open_door": "there is no service",
    }
    robot.perform("say", ["hello"])
    for before, after, named in (
        ("/odom", "/wheels", "/wheels"),
        ("move_base_msgs/MoveBase", "no_msgs/Drive", "no_msgs/DriveAction"),
        ("std_srvs/Trigger", "std_srvs/Pull", "std_srvs/Pull"),
    ):
        robot.disconnect()
        robot = robots.robot(text=CONNECTION.replace(before, after))
        with pytest.raises(NotReadyError, match=named):
            robot.connect()


@BOTH
def test_message_is_not_lost_right_after_the_connection(robots: Robots, kind: str) -> None:
    robot_itself = robots.move_base()
    robot = robots.robot(kind, CONNECTION[: CONNECTION.index("places:")] + SAY)
    robot.connect()
    assert robot.missing == {}
    robot.perform("say", ["hello"])
    assert read_event(robot_itself, "heard") == ["hello"]


def test_message_without_a_field_is_reported(robots: Robots) -> None:
    robots.move_base()
    robot = robots.robot(text=CONNECTION.replace("{data:", "{text:"))
    robot.connect()
    with pytest.raises(RobotLostError, match="text"):
        robot.perform("say", ["hello"])


@BOTH
def test_types_may_be_written_like_ros_1_or_ros_2(robots: Robots, kind: str) -> None:
    move_base = robots.move_base("--speed", "5", "--acceleration", "9")
    for action, service, topic in (
        ("move_base_msgs/MoveBaseAction", "std_srvs/Trigger", "std_msgs/String"),
        ("move_base_msgs/msg/MoveBaseAction", "std_srvs/srv/Trigger", "std_msgs/msg/String"),
        ("move_base_msgs/action/MoveBase", "std_srvs/srv/Trigger", "std_msgs/msg/String"),
    ):
        text = CONNECTION.replace("move_base_msgs/MoveBase", action)
        text = text.replace("std_srvs/Trigger", service).replace("std_msgs/String", topic)
        robot = robots.robot(kind, text)
        robot.connect()
        assert robot.missing == {}
        robot.perform("go_to", ["lab"])
        assert read_event(move_base, "goal") == [2.0, 0.0, 1.57, "map"]
        robot.perform("say", ["hello"])
        assert read_event(move_base, "heard") == ["Listen: hello"]
        robot.perform("open_door", [])
        read_event(move_base, "door")
        robot.disconnect()
