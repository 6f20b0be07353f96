"""Pictures on a real ROS 2 graph, from a server and from a camera."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.robots.base import CameraPicture
from codebotler.robots.ros.connections.connection_file import read_connection
from codebotler.robots.ros.worker import WORKERS_FOLDER
from halves import encoded, has_frame, rows, sees
from ros2_scene import ROS2_PYTHON, Scene
from ros_graph import Process
from server import Server

HERE = Path(__file__).parent
LOOK = SKILLS["is_in_room"]
TOPIC = "/camera/image_raw"
TOOL = """
import sys
from pathlib import Path
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.robots.base import Options
from codebotler.robots.ros import kinds
robot = kinds.ros2(Options(ros_python=Path(sys.argv[1]), skills=SkillTable((SKILLS["is_in_room"],))))
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
    eyes = process(scene, HERE / "ros2_eyes.py", str(WORKERS_FOLDER), json.dumps(LOOK.ros.definition))
    eyes.expect("ready")
    return eyes


@pytest.mark.usefixtures("eyes")
def test_any_server_may_show_pictures(scene: Scene) -> None:
    robot = scene.robot(skills=SkillTable((LOOK,)))
    robot.connect()

    def look(label: str) -> list[str | CameraPicture]:
        found: list[str | CameraPicture] = []
        assert robot.perform("is_in_room", [label], found.append) is False
        return found

    assert look("late") == [CameraPicture(bytes(8))]
    assert look("three") == [CameraPicture(bytes(8))] * 3
    began = time.monotonic()
    assert look("nothing") == []
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


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("Image", {"encoding": "bgr8", "width": 64, "height": 32, "step": 200, "data": [*rows("BGR", 8)]}),
        ("CompressedImage", {"format": "jpeg", "data": [*encoded("JPEG")]}),
    ],
)
def test_connected_camera_becomes_an_answer_and_a_picture(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, fields: dict[str, Any]
) -> None:
    process(scene, HERE / "ros2_camera.py", TOPIC, kind, json.dumps(fields)).expect("ready")
    path = tmp_path / "robot.yaml"
    path.write_text(f'skills: {{is_in_room: {{detector: "openai-chat:eyes", image: {TOPIC}}}}}')
    with Server(answer=sees) as model:
        monkeypatch.setenv("OPENAI_BASE_URL", model.url)
        robot = scene.robot(skills=SkillTable((LOOK,)), connection=read_connection(path, SKILLS))
        robot.connect()
        shown: list[str | CameraPicture] = []
        assert robot.perform("is_in_room", ["mug"], shown.append) is True
        (picture,) = shown
        assert isinstance(picture, CameraPicture)
        assert has_frame(picture.data)
        assert robot.perform("is_in_room", ["cat"]) is False
        robot.disconnect()


@pytest.mark.parametrize(("topic", "why"), [("/words", "is empty"), (TOPIC, "no picture")])
def test_messages_without_a_picture_are_reported(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, topic: str, why: str
) -> None:
    monkeypatch.setenv("OPENAI_BASE_URL", "http://localhost:1/v1")  # The model is not asked.
    process(scene, HERE / "ros2_camera.py", "/words", "String", "{}").expect("ready")
    path = tmp_path / "robot.yaml"
    path.write_text(f'skills: {{is_in_room: {{detector: "openai-chat:eyes", image: {topic}}}}}')
    robot = scene.robot(skills=SkillTable((LOOK,)), connection=read_connection(path, SKILLS))
    robot.connect()
    with pytest.raises(RobotError, match=why) as error:
        robot.perform("is_in_room", ["mug"])
    assert topic in str(error.value)
    robot.disconnect()
