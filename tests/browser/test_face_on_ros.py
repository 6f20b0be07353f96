"""The virtual robot drives on a real ROS graph, and speaks and asks on its face.

Without ROS 1, these tests are skipped and say so.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import expect

from codebotler.robots.base import ROS_PYTHON
from codebotler.robots.face import without_speech
from codebotler.robots.ros.kinds import INSTALL_ROS1, ROS1_MODULES
from codebotler.robots.ros.worker import find_missing
from faces import SPEAKING
from pageserver import WORLD, PageServer
from ros_graph import Graph
from server import Server
from viewing import TABLET, OpenPage

TEA = """def task_program():
    go_to("study")
    answer = ask("ann", "Would you like tea?", ["Yes", "No"])
    if answer == "Yes":
        go_to("kitchen")
        say("Tea for ann, please")
"""
WAITS = """def task_program():
    go_to("kitchen")
    ask("ann", "Would you like tea?", ["Yes", "No"])
"""


@pytest.fixture
def graph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    missing = find_missing(ROS_PYTHON, (*ROS1_MODULES, "rosmaster"))
    if missing is None or missing:
        pytest.skip(f"{ROS_PYTHON} lacks {missing or 'Python'}: {INSTALL_ROS1}")
    for name, value in (("ROS_HOME", "ros"), ("ROS_LOG_DIR", "ros/log")):
        monkeypatch.setenv(name, str(tmp_path / value))
    monkeypatch.setenv("ROS_HOSTNAME", "localhost")
    for name in ("ROS_MASTER_URI", "ROS_IP"):
        monkeypatch.delenv(name, raising=False)
    graph = Graph()
    try:
        yield graph
    finally:
        graph.end()


@pytest.fixture
def virtual(graph: Graph, tmp_path: Path) -> Iterator[Path]:
    """Start the virtual robot like a user does; return the file of its output."""
    (tmp_path / "house.yaml").write_text(WORLD)
    said = tmp_path / "virtual.txt"
    command = [sys.executable, "-u", "-m", "codebotler", "virtual-robot", "--world", "house.yaml"]
    with said.open("w") as file:
        robot = subprocess.Popen(
            [*command, "--speed", "10"],
            cwd=tmp_path,
            stdout=file,
            stderr=subprocess.PIPE,
            text=True,
            env={
                **os.environ,
                "CODEBOTLER_HOME": str(tmp_path / "virtual"),
                "ROS_MASTER_URI": graph.uri,
            },
        )
        assert robot.stderr is not None
        assert "the robot is ready" in robot.stderr.readline()
        yield said
        robot.terminate()
        robot.communicate(timeout=60)


def test_from_an_instruction_to_an_answer_on_a_real_graph(
    graph: Graph, virtual: Path, tmp_path: Path, open_page: OpenPage
) -> None:
    robot = ("--robot", "ros1", "--address", graph.uri, "--speed", "10", "--face")
    with (
        Server(answer=lambda _: TEA) as model,
        PageServer(tmp_path, *robot, "--model", "completions:m", "--base-url", model.url) as server,
    ):
        operator = open_page(server)
        face = open_page(server, link=server.face_link, size=TABLET, script=SPEAKING)
        operator.locator("textarea").fill("Ask ann in the study whether she would like tea.")
        operator.get_by_role("button", name="Write the program").click()
        expect(operator.get_by_text("Checked: no problems.")).to_be_visible()
        expect(operator.get_by_role("button", name="Run it on the robot")).to_be_enabled()
        operator.get_by_role("button", name="Run it on the robot").click()
        expect(face.locator("#doing")).to_have_text("On my way to study")
        expect(face.locator("#question")).to_have_text("Would you like tea?")
        face.locator("#options button", has_text="Yes").click()
        expect(operator.locator(".headline")).to_have_text("Done")
        expect(face.locator("#said p")).to_have_text("Tea for ann, please")
        server.run(WAITS)
        expect(face.locator("#question")).to_have_text("Would you like tea?")
        operator.locator("#stop").click()
        expect(operator.locator("#stop-told")).to_have_text("The robot has stopped.")
        expect(face.locator("#ended")).to_have_text("The question was withdrawn.")
        for page in (operator, face):
            page.context.close()
    done = virtual.read_text()
    assert "go_to(study)" in done
    assert "ask(" not in done
    assert "say(" not in done


def test_robot_with_a_face_needs_no_servers_for_speech(
    graph: Graph, tmp_path: Path, open_page: OpenPage
) -> None:
    server = graph.serve(*without_speech().rows)
    with PageServer(tmp_path, "--robot", "ros1", "--address", graph.uri, "--face", world=WORLD) as page:
        face = open_page(page, link=page.face_link, script=SPEAKING)
        page.run("def task_program():\n    say('hello')\n    go_to('study')\n    say('here')\n")
        expect(face.locator("#said p")).to_have_text(["hello", "here"])
        expect(face.locator("#doing")).to_have_text("I have finished.")
        face.context.close()
    heard = [said[1] for said in server.events.queue if said[0] == "goal"]
    assert "study" in heard
