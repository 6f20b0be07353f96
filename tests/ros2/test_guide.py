"""The files and servers on the pages about ROS 2 and Nav2 run unchanged on a real graph."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from codebotler.checking.house_rules.file import read_rules
from codebotler.core.errors import RobotError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.world import Room
from codebotler.robots.base import CancelledError
from codebotler.robots.ros.connections.connection_file import read_connection
from codebotler.robots.ros.keepout import keepout_messages as keepout_mask
from codebotler.robots.ros.worker import WORKERS_FOLDER
from error_tables import errors_on, unsaid
from ros2_scene import ROS2_PYTHON, Scene, installed
from ros_graph import GO_TO, Process, run_in_thread

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
ROS2, NAV2 = ((ROOT / "docs" / name).read_text() for name in ("ros.md", "nav2.md"))
ROOMS = (Room("cellar", footprint=((0, 0), (1, 0), (1, 1))),)
LINES = 25  # Most lines of a file that connects a robot.


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)


def test_table_of_servers_matches_the_skills() -> None:
    listed = {}
    for row in (line.split("|")[1:5] for line in ROS2.splitlines() if "_server`, " in line):
        skill, server, goal, result = row
        name, kind = re.findall(r"`(.*)`, (\w+)", server)[0]
        returned = re.findall("`(.*?) result`", result)
        listed[skill.strip(" `")] = (name, kind, tuple(re.findall("`(.*?)`", goal)), "".join(returned))
    assert listed == {
        skill.name: (skill.ros.server, skill.ros.type, skill.ros.goal, skill.ros.result or "")
        for skill in SKILLS.rows
        if skill.ros is not None
    }
    assert GO_TO.ros is not None
    assert f"```text\n{GO_TO.ros.definition}```" in ROS2


def test_server_of_the_page_works(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert GO_TO.ros is not None
    monkeypatch.setenv("PYTHONPATH", installed("robot_actions_pkg", {"GoTo": GO_TO.ros.definition}))
    code = next(block for block in blocks(ROS2, "python") if "rclpy" in block)
    script = tmp_path / "server.py"
    for line, said in {
        "rclpy.spin(": "ready",
        "    for _ in": "drives",
        "            goal.canceled()": "stops",
    }.items():
        indent = line[: len(line) - len(line.lstrip())]
        code = code.replace(f"\n{line}", f"\n{indent}print('[\"{said}\"]', flush=True)\n{line}")
    script.write_text(code)
    server = Process(script, python=ROS2_PYTHON)
    try:
        server.expect("ready")
        robot = scene.robot(skills=SkillTable((GO_TO,)))
        robot.connect()
        robot.perform("go_to", ["kitchen"])
        server.expect("drives")
        with pytest.raises(RobotError) as error:
            robot.perform("go_to", ["moon"])
        assert error.value.kind == "GoToInvalidLocation"
        with run_in_thread(lambda: robot.perform("go_to", ["hallway"])) as ended:
            server.expect("drives")
            robot.cancel()
            server.expect("stops")
        assert isinstance(ended["error"], CancelledError)
    finally:
        server.process.kill()
        server.end()


@pytest.mark.parametrize("option", ["--speed=3", "--door-jams"])
def test_robot_of_the_page_is_connected_by_its_file(scene: Scene, tmp_path: Path, option: str) -> None:
    robot, places, *_ = blocks(NAV2, "yaml")
    door, program, *_ = blocks(NAV2, "python")
    (command,) = re.findall(r"^codebotler (run .*)$", NAV2, re.MULTILINE)
    assert len(robot.splitlines()) <= LINES
    assert "# packages: [nav2_msgs]" in robot
    texts = {"robot.yaml": robot.replace("# packages", "packages"), "places.yaml": places}
    for name, text in {**texts, "door.py": door, "deliver.py": program}.items():
        (tmp_path / name).write_text(text)
    shutil.copytree(HERE / "nav2_msgs", tmp_path / "nav2_msgs")
    nav2 = Process(
        HERE / "nav2_stand_in.py", str(WORKERS_FOLDER), "--acceleration=9", option, python=ROS2_PYTHON
    )
    scene.processes.append(nav2)
    nav2.expect("ready")
    done = subprocess.run(
        [sys.executable, "-m", "codebotler", *command.split(), "--yes", "--ros-python", str(ROS2_PYTHON)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src"), "CODEBOTLER_HOME": str(tmp_path / "home")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    heard = []
    while not nav2.events.empty():
        heard.append(nav2.events.get())
    if option == "--door-jams":
        assert heard == [["door"], ["heard", "The door does not open."]]
    else:
        assert heard == [
            ["door"],
            ["goal", 2.0, 0.0, 1.57],
            ["ended", "succeed", 0, ""],
            ["heard", "I have arrived in the lab."],
        ]


def test_files_of_the_page_are_read(tmp_path: Path) -> None:
    robot, places, *_ = blocks(NAV2, "yaml")
    (tmp_path / "places.yaml").write_text(places)
    (tmp_path / "door.py").write_text(blocks(NAV2, "python")[0])
    table = skills_from(tmp_path / "door.py")
    (camera,) = (block for block in blocks(NAV2, "yaml") if block.startswith("skills:"))
    (keepout_messages,) = (block for block in blocks(NAV2, "yaml") if block.startswith("keepout:"))
    for text in (camera, robot + keepout_messages):
        (tmp_path / "robot.yaml").write_text(text)
        assert read_connection(tmp_path / "robot.yaml", table).skills(table)
    (rule,) = (block for block in blocks(NAV2, "yaml") if block.startswith("rules:"))
    (tmp_path / "rules.yaml").write_text(rule)
    assert any(keepout_mask(read_rules(tmp_path / "rules.yaml"), ROOMS)[0]["data"])


VARIES = (
    r"\.\.\.|(?<=died|sent): |/\w+(?:/\w+)*|ros2|robot_actions_pkg\S*|std_srvs\S*|nav2_msgs|signal 9"
    r"|'rclpy'|No module named"
    r'|codebotler(?= has)|c\+\+|"\w+"|node codebotler|field text|\bdata\b|service|action server|aborted|\d+'
)


@pytest.mark.parametrize(("page", "least"), [(ROS2, 15), (NAV2, 9)], ids=["ros.md", "nav2.md"])
def test_code_raises_every_error_on_the_page(page: str, least: int) -> None:
    assert len(errors_on(page)) >= least
    assert unsaid(page, VARIES) == []
