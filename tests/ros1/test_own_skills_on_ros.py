"""Custom skills over a real ROS graph: values of every type, and errors, go there and back."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bridges import bridge, ros_handler
from codebotler.core.errors import RobotError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.table import SkillTable
from codebotler.core.world import Room, World
from codebotler.robots.base import ROS_PYTHON, Options
from codebotler.robots.ros import kinds
from codebotler.robots.ros.caller import Timeouts, calls_data
from codebotler.robots.ros.connections.connection import default_connection
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.virtual import VirtualRobot
from codebotler.robots.ros.worker import WORKERS_FOLDER
from ros_graph import Graph

SKILLS = """
from typing import Literal
from codebotler import Simulation, skill

@skill(ros="lab_msgs/Mix:/mix", fails={"Spilt": "something was spilt"})
def mix(
    sim: Simulation, name: str, parts: int, share: float, hot: bool, how: Literal["stir", "shake"]
) -> list[str]:
    "Mix."
    if name == "too much":
        sim.fail("Spilt")
    return [f"{name} {parts!r} {share!r} {hot!r} {how}"]

@skill(ros="other_msgs/Sum:/sum_up")
def sum_up(sim: Simulation, numbers: list[int], shares: list[float]) -> float:
    "Sum."
    return sum(numbers) + sum(shares)

@skill(ros="lab_msgs/Ready:/ready")
def ready(sim: Simulation) -> bool:
    "Ready."
    return True
"""


@pytest.fixture(name="table")
def table_(tmp_path: Path) -> SkillTable:
    path = tmp_path / "lab.py"
    path.write_text(SKILLS)
    return skills_from(path)


@pytest.fixture(params=["ros1", "rosbridge"], name="robot")
def robot_(request: pytest.FixtureRequest, graph: Graph, table: SkillTable) -> Iterator[RosRobot]:
    virtual = VirtualRobot(World((Room("hall"),), "hall"), speed=None, address=graph.uri, skills=table)
    virtual.start()
    waits = Timeouts(patience=10.0, silence=5.0, longest=20.0)
    if request.param == "ros1":
        yield graph.robot(waits, skills=table)
    else:
        with bridge(ros_handler(graph.uri, tuple(table), table)) as double:
            behind = kinds.rosbridge(Options(address=double.address, skills=table), waits)
            yield behind
            behind.disconnect()
    virtual.stop()


def test_values_of_every_type_go_there_and_back(robot: RosRobot) -> None:
    robot.connect()
    assert robot.missing == {}
    done: list[Any] = [
        robot.perform("mix", ["tea", 3, 0.5, True, "stir"]),
        robot.perform("sum_up", [(1, 2), (0.25, 0.5)]),
        robot.perform("ready", []),
        robot.perform("get_all_rooms", []),
    ]
    assert done == [["tea 3 0.5 True stir"], 3.75, True, ["hall"]]
    with pytest.raises(RobotError, match="something was spilt") as caught:
        robot.perform("mix", ["too much", 1, 1, False, "shake"])
    assert caught.value.kind == "Spilt"


def test_messages_belong_to_the_package_that_a_skill_names(table: SkillTable) -> None:
    actions = [
        action
        for name, action in calls_data(default_connection(table)).items()
        if name in {"mix", "sum_up", "say"}
    ]
    said = subprocess.run(
        [str(ROS_PYTHON), "-c", TYPES, str(WORKERS_FOLDER), json.dumps(actions)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert sorted(said.split()) == [
        "lab_msgs/MixAction",
        "other_msgs/SumAction",
        "robot_actions_pkg/SayAction",
    ]


TYPES = """
import json, sys
sys.path.insert(0, sys.argv[1])
from message_types import action_types
print(*(spec._type for spec in action_types(json.loads(sys.argv[2])).values()))
"""
