"""The page on ROS says what is so."""

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
from codebotler.robots.ros.ros1 import MEND
from ros_graph import GO_TO, Graph, Process, free_port, installed, started

PAGE = (Path(__file__).parents[2] / "docs" / "ros.md").read_text()


def test_the_table_of_servers_is_that_of_the_skills() -> None:
    rows = [row.split("|")[1:5] for row in PAGE.splitlines() if "_server`, " in row]
    told = {}
    for skill, server, goal, result in rows:
        name, kind = re.findall(r"`(.*)`, (\w+)", server)[0]
        returned = re.findall("`(.*?) result`", result)
        told[skill.strip(" `")] = (name, kind, tuple(re.findall("`(.*?)`", goal)), "".join(returned))
    assert told == {
        skill.name: (skill.ros.server, skill.ros.type, skill.ros.goal, skill.ros.result or "")
        for skill in SKILLS.rows
        if skill.ros is not None
    }
    assert GO_TO.ros is not None
    assert f"```text\n{GO_TO.ros.definition}```" in PAGE


def test_the_packages_are_those_that_are_needed() -> None:
    assert re.sub(r" \\\n +", " ", PAGE).count(MEND) == 1


def test_two_commands_are_the_whole_path(tmp_path: Path) -> None:
    blocks = {kind: re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL) for kind in ("yaml", "python", "sh")}
    (tmp_path / "office.yaml").write_text(blocks["yaml"][0])
    (tmp_path / "mug.py").write_text(blocks["python"][0])
    robot, tool = (line.split()[1:] for line in blocks["sh"][1].splitlines())
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


def test_the_server_in_twenty_lines_does_what_it_must(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = next(
        block for block in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "actionlib" in block
    )
    assert len([line for line in code.splitlines() if line]) <= 22
    monkeypatch.setenv("PYTHONPATH", installed(tmp_path, "GoTo", "string location\n---\n---\n"))
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
    with started(lambda: robot.perform("go_to", ["hallway"])) as ended:
        while robot._number != 3:
            pass
        robot.cancel()
    assert isinstance(ended["error"], CancelledError)
    server.process.terminate()


VARIES = (
    r"\.\.\.|/\w+|ros1|robot_actions_pkg|signal 9|'rospy'|No module named|was lost"
    r"|GoToAction|Unable to import|\(|\d+"
)


def test_every_error_on_the_page_is_one_that_is_raised() -> None:
    sources = [
        path.read_text() for path in (Path(__file__).parents[2] / "src/codebotler/robots").rglob("*.py")
    ]
    text = re.sub(r'"\s*\n\s*f?"', "", "".join(sources))
    text = re.sub(r'"\s*\n\s*\+ \(f" ', " ", text)
    text = re.sub(r"\{[^}]*\}", "…", text)
    errors = re.findall(r"^\| `(.*?)` \| ", PAGE.partition("## What the errors mean")[2], re.MULTILINE)
    assert len(errors) >= 14
    for error in errors:
        for phrase in re.split(VARIES, error):
            assert phrase.strip(" :;,()`") in text, (error, phrase)
