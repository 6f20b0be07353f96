"""A real ROS 2 graph, on loopback only: action servers in processes of their own, and robots."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

from codebotler.core.skills.table import Skill, SkillTable
from codebotler.robots.base import Options
from codebotler.robots.ros import kinds
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.worker import WORKERS_FOLDER
from ros_graph import Process

HERE = Path(__file__).parents[1] / "ros2"
SERVER = HERE / "ros2_action_servers.py"
PROFILE = HERE / "loopback.xml"
ROS2_PYTHON = Path(os.environ.get("ROS2_PYTHON") or kinds.choose_python())
SHORT = Timeouts(patience=3.0, silence=0.5, longest=20.0)


BUILD = """
import json, sys
sys.path.insert(0, sys.argv[1])
from ros2_types import build_package
print("at", build_package(sys.argv[2], json.loads(sys.argv[3])))
"""


def installed(package: str, definitions: dict[str, str]) -> str:
    """Build a package unless that was done before; what is on the path if it is installed."""
    actions = {f"action/{name}": text for name, text in definitions.items()}
    done = subprocess.run(
        [str(ROS2_PYTHON), "-c", BUILD, str(WORKERS_FOLDER), package, json.dumps(actions)],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.splitlines()[-1].removeprefix("at ")


class Scene:
    """Who is on the graph."""

    def __init__(self) -> None:
        self.processes: list[Process] = []
        self.robots: list[RosRobot] = []
        self.served: list[Skill] = []

    def serve(self, *skills: Skill) -> Process:
        """An action server for each skill; what a goal says is how it goes."""
        self.served.extend(skill for skill in skills if skill not in self.served)
        actions = [
            [f"{s.ros.package}/action/{s.ros.type}", s.ros.server, s.ros.definition]
            for s in skills
            if s.ros is not None
        ]
        return self.serve_as(actions)

    def serve_as(self, actions: list[list[str]]) -> Process:
        """An action server for each type, name and definition."""
        server = Process(SERVER, str(WORKERS_FOLDER), json.dumps(actions), python=ROS2_PYTHON)
        self.processes.append(server)
        server.expect("ready")
        return server

    def robot(self, waits: Timeouts = SHORT, **options: Any) -> RosRobot:  # noqa: ANN401 - fields of Options
        skills = options.pop("skills", None) or SkillTable(tuple(self.served))  # others would be waited for
        robot = kinds.ros2(Options(ros_python=ROS2_PYTHON, skills=skills, **options), waits)
        self.robots.append(robot)
        return robot

    def end(self) -> None:
        for robot in self.robots:
            robot.disconnect()
        for process in self.processes:
            process.end()
