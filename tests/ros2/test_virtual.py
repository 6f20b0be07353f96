"""The virtual robot on a real ROS 2 graph, also with custom skills and as a command."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.world import Person, Room, World
from codebotler.robots.base import CancelledError, NotReadyError
from codebotler.robots.ros.virtual import VirtualRobot
from ros2_scene import ROS2_PYTHON, Scene
from ros_graph import run_in_thread

WORLD = World((Room("hall"), Room("kitchen", ("mug",), (Person("ann", ("yes",)),))), "hall")
OWN = """
from typing import Literal
from codebotler import Simulation, skill

@skill(ros="lab_msgs/Mix:/mix")
def mix(
    sim: Simulation, name: str, parts: int, share: float, hot: bool, how: Literal["stir", "shake"]
) -> list[str]:
    "Mix."
    return [f"{name} {parts!r} {share!r} {hot!r} {how}"]

@skill(ros="lab_msgs/Sum:/sum_up")
def sum_up(sim: Simulation, numbers: list[int], shares: list[float]) -> float:
    "Sum."
    return sum(numbers) + sum(shares)

@skill(ros="lab_msgs/Count:/count")
def count(sim: Simulation) -> list[int]:
    "Count."
    return [1, 2]
"""


@pytest.fixture
def virtual(request: pytest.FixtureRequest) -> Iterator[VirtualRobot]:
    skills = getattr(request, "param", SKILLS)
    virtual = VirtualRobot(WORLD, speed=None, ros=2, python=ROS2_PYTHON, skills=skills)
    virtual.start()
    yield virtual
    virtual.stop()


@pytest.mark.usefixtures("virtual")
def test_it_acts_on_the_graph_like_the_simulated_robot(scene: Scene) -> None:
    robot = scene.robot(skills=SKILLS)
    robot.connect()
    assert robot.missing == {}
    assert robot.perform("get_all_rooms", []) == ["hall", "kitchen"]
    assert robot.perform("go_to", ["kitchen"]) is None
    assert robot.perform("get_current_location", []) == "kitchen"
    assert robot.perform("is_in_room", ["mug"]) is True
    assert robot.perform("ask", ["ann", "Tea, „ann”?", ("yes", "no")]) == "yes"
    assert robot.perform("pick", ["mug"]) is None
    with pytest.raises(RobotError) as error:
        robot.perform("pick", ["mug"])
    assert error.value.kind == "PickFailed"


def test_it_stops_where_it_is(scene: Scene) -> None:
    virtual = VirtualRobot(WORLD, speed=1.0, ros=2, python=ROS2_PYTHON)
    virtual.start()
    robot = scene.robot(skills=SKILLS)
    robot.connect()
    with run_in_thread(lambda: robot.perform("go_to", ["kitchen"])) as ended:
        while not virtual._current:
            time.sleep(0.01)
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)
    robot.connect()
    assert robot.perform("get_current_location", []) == "hall"
    virtual.stop()


@pytest.mark.usefixtures("virtual")
def test_second_virtual_robot_is_refused() -> None:
    with pytest.raises(NotReadyError, match="another virtual robot"):
        VirtualRobot(WORLD, ros=2, python=ROS2_PYTHON).start()


def test_own_values_of_every_type_go_there_and_back(scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "lab.py").write_text(OWN)
    table: SkillTable = skills_from(tmp_path / "lab.py")
    virtual = VirtualRobot(WORLD, speed=None, ros=2, python=ROS2_PYTHON, skills=table)
    virtual.start()
    robot = scene.robot(skills=table)
    robot.connect()
    assert robot.missing == {}
    done: list[Any] = [
        robot.perform("mix", ["tea", 3, 1, True, "stir"]),
        robot.perform("sum_up", [(1, 2), (0.25, 1)]),
        robot.perform("count", []),
    ]
    assert done == [["tea 3 1.0 True stir"], 4.25, [1, 2]]
    virtual.stop()


def commands_on(page: str) -> list[list[str]]:
    """Return the options of each command in a block for ROS 2, without a trailing comment."""
    (block,) = re.findall(
        rf"<!-- run by tests/ros2/{Path(__file__).name} -->\n```sh\n(.*?)```", page, re.DOTALL
    )
    install, *commands = (line.partition("#")[0].split() for line in block.splitlines())
    assert install[-2:] == ["install", '".[ros2]"']
    return [options for _, *options in commands]


@pytest.mark.smoke
def test_commands_of_the_guide(tmp_path: Path) -> None:
    page, readme = ((Path(__file__).parents[2] / name).read_text() for name in ("docs/ros.md", "README.md"))
    of_robot, of_tool = commands_on(page)
    for ours, others in zip(commands_on(page), commands_on(readme), strict=True):
        assert [one for one in ours if "." not in one] == [one for one in others if "." not in one]
    for name, kind in {"office.yaml": "yaml", "mug.py": "python"}.items():
        (tmp_path / name).write_text(re.findall(rf"```{kind}\n(.*?)```", page, re.DOTALL)[0])
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(__file__).parents[2] / "src"),
        "CODEBOTLER_HOME": str(tmp_path / "home"),
    }
    command = [sys.executable, "-m", "codebotler"]
    python = ["--speed", "100", "--ros-python", str(ROS2_PYTHON)]
    with subprocess.Popen(
        [*command, *of_robot, *python],
        cwd=tmp_path,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as virtual:
        assert virtual.stderr is not None
        while not re.search(r"ROS_DOMAIN_ID \d+; the robot is ready", virtual.stderr.readline()):
            assert virtual.poll() is None
        run = subprocess.run(
            [*command, *of_tool, "--yes", *python],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        virtual.send_signal(signal.SIGINT)
        said, _ = virtual.communicate(timeout=60)
    assert run.returncode == 0, run.stderr
    assert [line for line in said.splitlines() if line.startswith(("go_to", "pick"))] == [
        "go_to(meeting room)",
        "go_to(kitchen)",
        "pick(mug)",
        "go_to(meeting room)",
    ]
