"""The page on ROS 1 shows valid commands, code and errors."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.robots.base import CancelledError
from codebotler.robots.ros.connections.connection_file import read_connection
from codebotler.robots.ros.kinds import INSTALL_ROS1
from error_tables import errors_on, unsaid
from ros_graph import Graph, Process, free_port, install_action, run_in_thread

DOCS = Path(__file__).parents[2] / "docs"
PAGE, ROS2 = ((DOCS / name).read_text() for name in ("ros1.md", "ros.md"))


def test_page_names_the_needed_packages() -> None:
    assert re.sub(r" \\\n +", " ", PAGE).count(INSTALL_ROS1) == 1


def test_two_commands_run_a_program_on_a_robot(tmp_path: Path) -> None:
    office, program = (re.findall(rf"```{kind}\n(.*?)```", ROS2, re.DOTALL)[0] for kind in ("yaml", "python"))
    (tmp_path / "office.yaml").write_text(office)
    (tmp_path / "mug.py").write_text(program)
    robot, tool = (line.split() for line in re.findall("^codebotler (.*)", PAGE, re.MULTILINE))
    port = free_port()
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(__file__).parents[2] / "src"),
        "CODEBOTLER_HOME": str(tmp_path),
        "ROS_MASTER_URI": f"http://localhost:{port}",
    }
    command = [sys.executable, "-m", "codebotler"]
    with subprocess.Popen(
        [*command, *robot, "--speed", "20"], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True
    ) as virtual:
        assert virtual.stderr is not None
        assert "a ROS master was started" in virtual.stderr.readline()
        done = subprocess.run(
            [*command, *tool, "--speed", "20", "--yes"],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        virtual.terminate()
    assert (done.returncode, "robot ros1" in done.stdout) == (0, True), done.stderr
    assert 'puts down "mug"' in done.stdout


def test_short_server_of_the_page_works(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = next(
        block for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "actionlib" in block
    )
    assert len([line for line in code.splitlines() if line]) <= 22
    monkeypatch.setenv("PYTHONPATH", install_action(tmp_path, "GoTo", "string location\n---\n---\n"))
    script = tmp_path / "server.py"
    script.write_text(code.replace("server.start()\n", "server.start()\nprint('[\"ready\"]', flush=True)\n"))
    server = Process(script, master=graph.uri)
    graph.processes.append(server)
    server.expect("ready")
    robot = graph.robot()
    robot.connect()
    robot.perform("go_to", ["kitchen"])
    with pytest.raises(RobotError) as error:
        robot.perform("go_to", ["moon"])
    assert (error.value.kind, str(error.value)) == ("GoToInvalidLocation", 'I know no room "moon"')
    with run_in_thread(lambda: robot.perform("go_to", ["hallway"])) as ended:
        while robot._number != 3:
            pass
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)
    server.process.terminate()


def test_file_of_the_page_is_read(tmp_path: Path) -> None:
    (file,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "robot.yaml").write_text(file)
    (tmp_path / "places.yaml").write_text("places: {dock: {x: 0, y: 0}}\n")
    connection = read_connection(tmp_path / "robot.yaml", SKILLS)
    assert (connection.robot, connection.calls["go_to"].type) == ("ros1", "move_base_msgs/action/MoveBase")


VARIES = (
    r"\.\.\.|(?<=died): |/\w+|ros1|robot_actions_pkg|signal 9|'rospy'|No module named|was lost"
    r"|GoToAction|Unable to import|\(|\d+"
)


def test_code_raises_every_error_on_the_page() -> None:
    assert len(errors_on(PAGE)) >= 13
    assert unsaid(PAGE, VARIES) == []
