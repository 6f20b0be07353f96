"""A file connects an unchanged robot with Nav2: goals, results, errors and stops."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from codebotler.checking.house_rules.file import read_rules
from codebotler.core.errors import RobotError
from codebotler.core.skills.files import skills_from
from codebotler.missions.display.progress import POSITION_FEEDBACK
from codebotler.robots.base import CameraPicture, CancelledError, NotReadyError, RobotLostError
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.connections.connection_file import read_connection
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.worker import WORKERS_FOLDER
from ros2_scene import ROS2_PYTHON, SHORT, Scene
from ros_graph import LONG, Process, run_in_thread

STAND_IN = Path(__file__).with_name("nav2_stand_in.py")
PACKAGE = Path(__file__).with_name("nav2_msgs")

CONNECTION = f"""\
places: places.yaml
pose: {{topic: /amcl_pose}}
velocity: {{topic: /odom}}
packages: [{PACKAGE}]
skills:
  go_to: {{action: /navigate_to_pose, type: nav2_msgs/action/NavigateToPose, goal: {{pose: $place}}}}
  say: {{topic: /speech, type: std_msgs/msg/String, message: {{data: "Listen: $message"}}}}
  open_door: {{service: /door/open, type: std_srvs/srv/Trigger, success: success}}
"""
PLACES = """\
frame: map
places:
  dock: {x: 0, y: 0, polygon: [[-1, -1], [1, -1], [1, 1], [-1, 1]]}
  lab: {x: 2, y: 0, yaw: 1.57}
  cellar: {polygon: [[3, -1.5], [5, -1.5], [5, 1.5], [3, 1.5]]}
  hall: {x: 7, y: 0}
  shaft: {x: 5, y: 5}
  moon: {x: 9, y: -9}
"""
SKILLS = """\
from codebotler import Simulation, skill


@skill
def open_door(sim: Simulation) -> None:
    \"\"\"Open the door.\"\"\"
"""


class Robots:
    """A robot with Nav2, and the connections to it."""

    def __init__(self, scene: Scene, folder: Path) -> None:
        self.scene, self.folder = scene, folder

    def nav2(self, *options: str) -> Process:
        process = Process(STAND_IN, str(WORKERS_FOLDER), *options, python=ROS2_PYTHON)
        self.scene.processes.append(process)
        process.expect("ready")
        return process

    def robot(self, connection: str = CONNECTION, waits: Timeouts = SHORT) -> RosRobot:
        for name, text in {"robot.yaml": connection, "places.yaml": PLACES, "door.py": SKILLS}.items():
            (self.folder / name).write_text(text)
        table = skills_from(self.folder / "door.py")
        read = read_connection(self.folder / "robot.yaml", table)
        return self.scene.robot(waits, skills=table, connection=read)


def read_event(process: Process, what: str) -> list[object]:
    """Return the details of the stand-in's next event of a kind."""
    while True:
        kind, *about = process.events.get(timeout=LONG)
        if kind == what:
            return about


@pytest.fixture
def robots(scene: Scene, tmp_path: Path) -> Robots:
    return Robots(scene, tmp_path)


def test_skills_are_those_of_the_file(robots: Robots) -> None:
    nav2 = robots.nav2("--speed", "5", "--acceleration", "9")
    robot = robots.robot()
    robot.connect()
    assert [*robot.skills] == ["get_current_location", "get_all_rooms", "go_to", "say", "open_door"]
    assert robot.missing == {}
    assert robot.perform("get_all_rooms", []) == ["dock", "lab", "cellar", "hall", "shaft", "moon"]
    assert robot.perform("get_current_location", []) == "dock"
    reported: list[str | CameraPicture] = []
    robot.perform("go_to", ["Lab"], reported.append)
    assert read_event(nav2, "goal") == [2.0, 0.0, 1.57]
    assert any(str(one).startswith("at (1.") for one in reported)
    assert robot.perform("get_current_location", [], reported.append) == "lab"  # No room contains it.
    assert "lab, the nearest" in str(reported[-1])
    robot.perform("say", ["it is open"])
    assert read_event(nav2, "heard") == ["Listen: it is open"]
    robot.perform("open_door", [])
    read_event(nav2, "door")
    assert robot.has_pose


def test_failure_is_a_robot_error_with_the_robots_message(robots: Robots) -> None:
    robots.nav2("--obstacle", "4,4,6,6", "--door-jams", "--recoveries", "1")
    robot = robots.robot()
    robot.connect()
    kinds = {}
    for skill, arguments in {"go_to": ["shaft"], "open_door": []}.items():
        with pytest.raises(RobotError) as error:
            robot.perform(skill, arguments)
        kinds[error.value.kind] = str(error.value)
    assert "206" in kinds["GoToFailed"]
    assert "jam" in kinds["OpenDoorFailed"]
    with pytest.raises(RobotError) as error:
        robot.perform("go_to", ["attic"])
    assert error.value.kind == "GoToInvalidLocation"


def test_stop_ends_when_the_robot_stands_still(robots: Robots) -> None:
    nav2 = robots.nav2("--speed", "2", "--acceleration", "2")
    robot = robots.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["moon"])) as ended:
        read_event(nav2, "goal")
        time.sleep(1.0)
        asked = time.monotonic()
        robot.cancel()
        read_event(nav2, "cancel")
        assert time.monotonic() - asked < 1.0
    assert isinstance(ended["error"], CancelledError)
    assert robot.failed_stop == ""
    assert 1.0 < time.monotonic() - asked < 4.0  # It brakes for a second.


def test_robot_that_goes_on_after_a_stop_is_lost(robots: Robots) -> None:
    nav2 = robots.nav2("--never-stops")
    robot = robots.robot()
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["moon"])) as ended:
        read_event(nav2, "goal")
        time.sleep(0.7)
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)
    assert "BY HAND" in robot.failed_stop


SLOW_DOOR = """
import os, sys, threading, time
import rclpy
from std_srvs.srv import Trigger

def open_door(_, answer):
    print('["opening"]', flush=True)
    time.sleep(60)
    return answer

rclpy.init()
node = rclpy.create_node("door")
node.create_service(Trigger, "/door/open", open_door)
threading.Thread(target=rclpy.spin, args=(node,), daemon=True).start()
print('["ready"]', flush=True)
sys.stdin.read()
os._exit(0)
"""
DOOR = """\
skills:
  open_door: {service: /door/open, type: std_srvs/srv/Trigger, success: success}
"""


def test_service_that_goes_on_after_a_stop_is_reported(robots: Robots, tmp_path: Path) -> None:
    (tmp_path / "slow_door.py").write_text(SLOW_DOOR)
    door = Process(tmp_path / "slow_door.py", python=ROS2_PYTHON)
    robots.scene.processes.append(door)
    door.expect("ready")
    robot = robots.robot(DOOR)
    robot.connect()
    with run_in_thread(lambda: robot.perform("open_door", [])) as ended:
        door.expect("opening")
        robot.cancel()
    assert isinstance(ended["error"], RobotLostError)
    assert re.search("/door/open .*stop", str(ended["error"]))


def test_poses_in_another_frame_are_refused(robots: Robots) -> None:
    robots.nav2()
    robot = robots.robot(CONNECTION.replace("/amcl_pose", "/odom"))
    with pytest.raises(NotReadyError, match=r'"odom".*"map"'):
        robot.connect()


def test_topic_without_a_publisher_and_message_without_a_field_are_reported(robots: Robots) -> None:
    robots.nav2()
    robot = robots.robot(CONNECTION.replace("/amcl_pose", "/nothing"))
    with pytest.raises(NotReadyError, match="/nothing"):
        robot.connect()
    robot = robots.robot(CONNECTION.replace("{data:", "{text:"))
    robot.connect()
    with pytest.raises(RobotLostError, match="text"):
        robot.perform("say", ["hello"])


def test_pose_comes_from_transforms(robots: Robots) -> None:
    robots.nav2("--start", "3,4,1.0")
    package = PACKAGE.with_name("tf2_msgs")
    text = CONNECTION.replace("{topic: /amcl_pose}", "{tf: {from: map, to: base_link}}")
    robot = robots.robot(text.replace("packages: [", f"packages: [{package}, "))
    robot.connect()
    pose = robot._pose()
    assert pose is not None
    assert math.dist((pose.x, pose.y, pose.yaw), (3, 4, 1.0)) < 0.01


KEEPOUT = "keepout: {mask: /keepout_mask, info: /costmap_filter_info}\nskills:"
RULE = """\
rules:
  - name: not-the-cellar
    says: Never be in the cellar.
    always: not tr.Exists(inside("cellar"))
"""


def test_planner_keeps_out_of_rooms_that_rules_forbid(robots: Robots) -> None:
    nav2 = robots.nav2("--speed", "3", "--acceleration", "9")
    robot = robots.robot(CONNECTION.replace("skills:", KEEPOUT))
    (robots.folder / "rules.yaml").write_text(RULE)
    robot.connect()
    robot.keep_out(read_rules(robots.folder / "rules.yaml"))
    width, height, cells = read_event(nav2, "mask")
    assert [width, height, cells] == [40, 60, 40 * 60]  # 2 m by 3 m
    reported: list[str | CameraPicture] = []
    robot.perform("go_to", ["hall"], reported.append)
    way = [tuple(map(float, match)) for one in reported for match in re.findall(POSITION_FEEDBACK, str(one))]
    assert len(way) > 5
    assert not [(x, y) for x, y in way if 3 < x < 5 and -1.5 < y < 1.5]
    robot.keep_out(())
    assert read_event(nav2, "mask") == [1, 1, 0]


def test_mission_ends_where_the_robot_enters_a_forbidden_room(robots: Robots) -> None:
    nav2 = robots.nav2("--speed", "2", "--acceleration", "9")
    status, output = run_mission(robots, "    go_to('hall')\n    say('there')\n")
    assert status == 1, output
    assert "not-the-cellar" in output
    read_event(nav2, "goal")
    read_event(nav2, "cancel")


LATCHED = """\
import time
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, QoSProfile

rclpy.init()
node = rclpy.create_node("localization")
qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
pose = PoseStamped()
pose.header.frame_id = "map"
publisher = node.create_publisher(PoseStamped, "/once", qos)
publisher.publish(pose)
print('["ready"]', flush=True)
time.sleep(60)
"""


def run_mission(robots: Robots, program: str, connection: str = CONNECTION) -> tuple[int, str]:
    """Run a program under the rule; return the exit status and the output."""
    robots.robot(connection)
    (robots.folder / "rules.yaml").write_text(RULE)
    (robots.folder / "drive.py").write_text(f"def task_program():\n{program}")
    files = [str(robots.folder / name) for name in ("robot.yaml", "door.py", "rules.yaml", "drive.py")]
    command = ["run", files[3], "--connect", files[0], "--skills", files[1], "--rules", files[2], "--yes"]
    environment = {**os.environ, "CODEBOTLER_HOME": str(robots.folder / "home")}
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "codebotler",
            *command,
            "--despite-problems",
            "--ros-python",
            str(ROS2_PYTHON),
        ],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    return done.returncode, done.stdout + done.stderr


def test_robot_that_drives_on_without_a_pose_is_stopped(robots: Robots, tmp_path: Path) -> None:
    nav2 = robots.nav2("--speed", "2", "--acceleration", "9")
    (tmp_path / "once.py").write_text(LATCHED)
    localization = Process(tmp_path / "once.py", python=ROS2_PYTHON)
    robots.scene.processes.append(localization)
    localization.expect("ready")
    connection = CONNECTION.replace("/amcl_pose", "/once")
    status, output = run_mission(robots, "    go_to('hall')\n    say('there')\n", connection)
    assert status == 1
    assert "stopped reporting its position" in output
    read_event(nav2, "goal")
    read_event(nav2, "cancel")
