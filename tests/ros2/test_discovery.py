"""Discovery on a real ROS 2 graph writes a first file for `--connect`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from codebotler.cli.app import app
from codebotler.core.skills.paper import SKILLS
from ros2_scene import HERE, ROS2_PYTHON, Scene
from ros_graph import Process

PAGE = Path(__file__).parents[2] / "docs" / "nav2.md"


def test_file_has_what_robots_offer(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.serve(SKILLS["go_to"], SKILLS["ask"])
    scene.processes.append(offers := Process(HERE / "ros2_offers.py", python=ROS2_PYTHON))
    offers.expect("ready")
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "robot.yaml"
    (of_guide,) = re.findall(r"^codebotler (connect .*)$", PAGE.read_text(), re.MULTILINE)
    command = [*of_guide.split(), "--ros-python", str(ROS2_PYTHON)]
    assert CliRunner().invoke(app, command).exit_code == 0
    text = file.read_text()
    written: dict[str, Any] = yaml.safe_load(text)
    assert written["robot"] == "ros2"
    assert written["pose"] == {"topic": "/amcl_pose"}
    assert written["skills"] == {
        "go_to": {
            "action": "/go_to_server",
            "type": "robot_actions_pkg/action/GoTo",
            "goal": {"location": "$location"},
        },
        "ask": {
            "action": "/ask_server",
            "type": "robot_actions_pkg/action/Ask",
            "goal": {"person": "$person", "question": "$question", "options": "$options"},
            "result": "result",
        },
        "say": {"topic": "/speech", "type": "std_msgs/msg/String", "message": {"data": "$message"}},
    }
    assert "# open_door: {service: /door/open, type: std_srvs/srv/Trigger, " in text
    assert text.partition("# Not mapped:")[2].splitlines() == ["", "#   /battery std_msgs/msg/String"]
    assert CliRunner().invoke(app, command).exception
    assert file.read_text() == text
