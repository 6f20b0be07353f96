"""`codebotler run` on a real ROS graph: its messages before the robot moves, and how it stops."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from bridges import bridge, ros_handler
from codebotler.core.skills.paper import SKILLS
from forked import Forked
from ros_graph import GO_TO, Graph

FETCH = 'def task_program():\n    go_to("the hall")\n    if is_in_room("mug"):\n        pick("mug")\n'
FAR = """def task_program():
    for _ in range(9):
        try:
            go_to("never")
        except BaseException:
            pass
"""


RULES = """rules:
  - name: vault
    says: Never go into the vault.
    always: not tr.Exists(goto("vault"))
"""
STUBBORN = """def task_program():
    go_to("the hall")
    for _ in range(9):
        try:
            go_to("the vault")
        except BaseException:
            say("I go on")
"""


@contextmanager
def run_tool(
    graph: Graph,
    folder: Path,
    program: str,
    *options: str,
    robot: str = "ros1",
    command: Sequence[str] = (),
) -> Iterator[Forked | subprocess.Popen[str]]:
    """Start a mission in a process that is forked or, with a command for Python, starts as a whole."""
    (folder / "program.py").write_text(program)
    words = ("run", "program.py", "--robot", robot, "--yes", *options)
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(__file__).parents[2] / "src"),
        "CODEBOTLER_HOME": str(folder),
        "ROS_MASTER_URI": graph.uri,
    }
    with (
        subprocess.Popen(
            [sys.executable, *command, *words],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        if command
        else Forked("codebotler", *words, cwd=folder, environment=environment)
    ) as tool:
        try:
            yield tool
        finally:
            tool.kill()


def test_missing_skill_is_reported_before_the_robot_moves(graph: Graph, tmp_path: Path) -> None:
    server = graph.serve(*(skill for skill in SKILLS.rows if skill.name != "pick"))
    with run_tool(graph, tmp_path, FETCH) as tool:
        out, err = tool.communicate()

    assert (tool.returncode, "running on" in out) == (1, False)
    assert re.search("line 4: this robot has no `pick` skill: .*/pick_server", err)
    assert "--despite-problems" in err
    assert '"the hall"' not in str(list(server.events.queue))


def test_robot_without_a_list_of_rooms_works(graph: Graph, tmp_path: Path) -> None:
    server = graph.serve(GO_TO)
    with run_tool(graph, tmp_path, 'def task_program():\n    go_to("the hall")\n') as tool:
        _, err = tool.communicate()
    assert tool.returncode == 0, err
    server.expect("goal", "the hall")


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signal_cancels_the_goal_and_no_other_is_sent(
    graph: Graph, tmp_path: Path, number: int, status: int
) -> None:
    server = graph.serve(*SKILLS.rows)
    with run_tool(graph, tmp_path, FAR, "--despite-problems") as tool:
        server.expect("goal", "")
        server.expect("goal", "")
        server.expect("goal", "never")
        tool.send_signal(number)
        out, err = tool.communicate()
    server.expect("cancel", "never")
    assert (tool.returncode, server.events.empty()) == (status, True), err
    assert "stopped by" in out


# In this tool, a thread makes a call during which no other thread can run, not even for Ctrl-C.
FROZEN_SECONDS = 6
FROZEN = f"""
import ctypes, sys, threading, time
from pathlib import Path

def freeze():
    while not Path("freeze").exists():
        time.sleep(0.01)
    ctypes.PyDLL(None).creat(b"frozen", 0o600)
    ctypes.PyDLL(None).sleep({FROZEN_SECONDS})

threading.Thread(target=freeze, daemon=True).start()
sys.argv[0] = "codebotler"
from codebotler.__main__ import main
main()
"""


@pytest.mark.parametrize("robot", ["ros1", "rosbridge"])
def test_robot_is_stopped_while_the_tool_is_frozen(graph: Graph, tmp_path: Path, robot: str) -> None:
    server = graph.serve(*SKILLS.rows)
    with bridge(ros_handler(graph.uri)) as double:
        address = ("--address", double.address) if robot == "rosbridge" else ()
        options = ("--despite-problems", *address)
        with run_tool(graph, tmp_path, FAR, *options, robot=robot, command=("-c", FROZEN)) as tool:
            for goal in ("", "", "never"):
                server.expect("goal", goal)
            (tmp_path / "freeze").touch()
            while not (tmp_path / "frozen").exists():
                time.sleep(0.01)
            frozen = time.monotonic()
            tool.send_signal(signal.SIGINT)
            server.expect("cancel", "never")
            assert time.monotonic() - frozen < FROZEN_SECONDS / 2
            _, err = tool.communicate()
    assert tool.returncode in {1, 130}, err
    assert server.events.empty()


def test_suspended_tool_stops_the_robot_and_reports_it(graph: Graph, tmp_path: Path) -> None:
    server = graph.serve(*SKILLS.rows)
    with run_tool(graph, tmp_path, FAR, "--despite-problems") as tool:
        for goal in ("", "", "never"):
            server.expect("goal", goal)
        tool.send_signal(signal.SIGSTOP)
        try:
            server.expect("cancel", "never")
        finally:
            tool.send_signal(signal.SIGCONT)
        out, err = tool.communicate()
    assert (tool.returncode, server.events.empty()) == (1, True), err
    assert "no sign of life" in out + err


@pytest.mark.parametrize("robot", ["ros1", "rosbridge"])
def test_goal_that_breaks_a_house_rule_is_never_sent(graph: Graph, tmp_path: Path, robot: str) -> None:
    server = graph.serve(*SKILLS.rows)
    (tmp_path / "house.yaml").write_text(RULES)
    options = ("--rules", "house.yaml", "--despite-problems")
    with bridge(ros_handler(graph.uri)) as double:
        address = ("--address", double.address) if robot == "rosbridge" else ()
        with run_tool(graph, tmp_path, STUBBORN, *options, *address, robot=robot) as tool:
            out, err = tool.communicate()
    assert "stopped by rule vault" in out, err
    for goal in ("", "", "the hall"):  # The first goals ask for its rooms and its location.
        server.expect("goal", goal)
    assert server.events.empty()
