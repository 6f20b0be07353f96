"""Pictures on a real ROS 2 graph: those that a server shows, and those of a camera."""

from __future__ import annotations

import base64
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.robots.base import Picture
from codebotler.robots.ros.worker import WORKERS
from ros2_scene import ROS2_PYTHON, Scene
from ros_graph import LONG, Process

HERE = Path(__file__).parent
LOOK = SKILLS["is_in_room"]
TOPIC = "/camera/image_raw"
IMAGE = {"encoding": "rgb8", "width": 2, "height": 1, "step": 6, "data": [1, 2, 3, 4, 5, 6]}
LOOKS = """
import json, os, sys
sys.path.insert(0, sys.argv[1])
from ros2_camera import Ros2Camera
from ros2_graph import Ros2Graph

graph = Ros2Graph("looker")
graph.enter()
camera = Ros2Camera(graph, sys.argv[2])
graph.spin()
for line in sys.stdin:
    print(json.dumps([camera.look(float(line))]), flush=True)
os._exit(0)
"""
TOOL = """
import sys
from pathlib import Path
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.robots.base import Options
from codebotler.robots.ros import ros2
robot = ros2.robot(Options(ros_python=Path(sys.argv[1]), skills=SkillTable((SKILLS["is_in_room"],))))
robot.connect()
robot.perform("is_in_room", ["never"])
"""


def process(scene: Scene, script: Path, *arguments: str) -> Process:
    started = Process(script, *arguments, python=ROS2_PYTHON)
    scene.processes.append(started)
    return started


@pytest.fixture
def eyes(scene: Scene) -> Process:
    assert LOOK.ros is not None
    eyes = process(scene, HERE / "ros2_eyes.py", str(WORKERS), json.dumps(LOOK.ros.definition))
    eyes.expect("ready")
    return eyes


@pytest.mark.usefixtures("eyes")
def test_any_server_may_show_what_it_sees(scene: Scene) -> None:
    robot = scene.robot(skills=SkillTable((LOOK,)))
    robot.connect()

    def told(label: str) -> list[str | Picture]:
        heard: list[str | Picture] = []
        assert robot.perform("is_in_room", [label], heard.append) is False
        return heard

    assert told("late") == [Picture(bytes(8))]
    assert told("three") == [Picture(bytes(8))] * 3
    (left_out,) = told("huge")
    assert isinstance(left_out, str)
    assert "3,000,000 bytes" in left_out
    assert "2,000,000" in left_out
    began = time.monotonic()
    assert told("nothing") == []
    assert time.monotonic() - began < 1.0


def test_suspended_tool_that_reads_no_pictures_stops_the_robot(eyes: Process) -> None:
    source = str(Path(__file__).parents[2] / "src")
    with subprocess.Popen(
        [sys.executable, "-c", TOOL, str(ROS2_PYTHON)], env={**os.environ, "PYTHONPATH": source}
    ) as tool:
        eyes.expect("goal")
        tool.send_signal(signal.SIGSTOP)
        suspended = time.monotonic()
        eyes.expect("cancel")
        assert time.monotonic() - suspended < 2
        tool.kill()


def looks(looker: Process, oldest: float) -> dict[str, Any]:
    assert looker.process.stdin is not None
    looker.process.stdin.write(f"{oldest}\n")
    looker.process.stdin.flush()
    (seen,) = looker.said.get(timeout=LONG)
    assert isinstance(seen, dict)
    return seen


def seen_at_last(looker: Process) -> dict[str, Any]:
    until = time.monotonic() + LONG
    while "no picture has arrived" in (seen := looks(looker, 60)).get("none", ""):
        assert time.monotonic() < until
        time.sleep(0.1)
    return seen


@pytest.mark.parametrize(
    ("kind", "fields"), [("Image", IMAGE), ("CompressedImage", {"format": "jpeg", "data": [255, 0]})]
)
def test_last_picture_of_a_camera(scene: Scene, tmp_path: Path, kind: str, fields: dict[str, Any]) -> None:
    (tmp_path / "looks.py").write_text(LOOKS)
    looker = process(scene, tmp_path / "looks.py", str(WORKERS), TOPIC)
    assert TOPIC in looks(looker, 60)["none"]
    camera = process(scene, HERE / "ros2_camera.py", TOPIC, kind, json.dumps(fields))
    camera.expect("ready")
    seen = seen_at_last(looker)
    assert base64.b64decode(seen["data"]) == bytes(fields["data"])
    assert {**seen, **{name: value for name, value in fields.items() if name != "data"}} == seen
    camera.end()
    time.sleep(1.0)
    assert "ago" in looks(looker, 0.5)["none"]
    assert "data" in looks(looker, 60)


def test_what_is_no_picture_is_said(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "looks.py").write_text(LOOKS)
    looker = process(scene, tmp_path / "looks.py", str(WORKERS), "/words")
    process(scene, HERE / "ros2_camera.py", "/words", "String", "{}").expect("ready")
    why = seen_at_last(looker)["none"]
    for part in ("/words", "std_msgs/msg/String", "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"):
        assert part in why
