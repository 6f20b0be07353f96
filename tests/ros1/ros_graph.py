"""A real ROS graph: a rosmaster on a free port, and action servers in separate processes."""

from __future__ import annotations

import json
import os
import queue
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.robots.base import ROS_PYTHON, Options
from codebotler.robots.reservation import robot_file
from codebotler.robots.ros import kinds
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.worker import WORKERS_FOLDER
from forked_on_ros import start

HERE = Path(__file__).parent
MASTER = HERE / "ros_master.py"
SERVER = HERE / "action_servers.py"
LONG = 60.0  # Seconds until a wait has failed.
GO_TO, SAY = SKILLS["go_to"], SKILLS["say"]
FEW = SkillTable((GO_TO, SAY))
"""Enough for most tests, because workers need long to make the messages of all skills."""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def forget_goals(robot: str, address: str) -> None:
    """Delete what killed connections left about their goals, which ended with their servers.

    The system hands out each port again, and then another test would have to cancel these goals.
    """
    ours = robot_file(robot, address, "goal")
    for sign in ours.parent.glob(f"{ours.stem}.*.goal"):
        sign.unlink()


class Process:
    """A script in a Python with ROS; it prints a JSON event per line, and ends with its input."""

    def __init__(
        self,
        script: Path,
        *arguments: str,
        python: Path = ROS_PYTHON,
        master: str = "",
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self.events: queue.Queue[list[Any]] = queue.Queue()
        self.process = start(
            [str(python), str(script), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "ROS_MASTER_URI": master, **(environment or {})},
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("["):
                self.events.put(json.loads(line))

    def expect(self, *what: str) -> None:
        """Wait for the next event, which must be this one."""
        assert self.events.get(timeout=LONG) == list(what)

    def end(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._reader.join(LONG)
        assert self.process.stdout is not None
        self.process.stdout.close()

    def kill(self) -> None:
        os.kill(self.process.pid, signal.SIGKILL)
        self.end()


class Graph:
    """A separate ROS graph."""

    def __init__(self) -> None:
        self.port = free_port()
        self.uri = f"http://localhost:{self.port}"
        self.processes: list[Process] = []
        self.robots: list[RosRobot] = []
        forget_goals("ros1", self.uri)
        self.start_master()

    def start_master(self) -> None:
        self.master = Process(MASTER, str(self.port))
        self.master.expect("ready")

    def serve(self, *skills: Skill, **environment: str) -> Process:
        """Start an action server for each skill; the text of a goal selects its result."""
        actions = [[s.ros.type, s.ros.server, s.ros.definition] for s in skills if s.ros is not None]
        server = Process(
            SERVER, str(WORKERS_FOLDER), json.dumps(actions), environment=environment, master=self.uri
        )
        self.processes.append(server)
        server.expect("ready")
        return server

    def robot(
        self,
        waits: Timeouts | None = None,
        *,
        skills: SkillTable = FEW,
        **options: Any,  # noqa: ANN401 - fields of Options
    ) -> RosRobot:
        short = Timeouts(patience=1.5, silence=1.5, longest=20.0)
        robot = kinds.ros1(Options(address=self.uri, skills=skills, **options), waits or short)
        self.robots.append(robot)
        return robot

    def end(self) -> None:
        for robot in self.robots:
            robot.disconnect()
        for process in [*self.processes, self.master]:
            process.end()


@contextmanager
def run_in_thread(function: Callable[[], object]) -> Iterator[dict[str, object]]:
    """Call a function in a thread; yield a dictionary that gets its value or its error at the end."""
    ended: dict[str, object] = {}

    def run() -> None:
        try:
            ended["value"] = function()
        except Exception as error:  # noqa: BLE001 - checked by the test
            ended["error"] = error

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    yield ended
    thread.join(LONG)
    assert not thread.is_alive()


ACTION_PACKAGE = """
import sys
sys.path.insert(0, {worker!r})
from message_types import generate_action
action = generate_action("robot_actions_pkg", {name!r}, {definition!r})()
wholes = (action.action_goal, action.action_result, action.action_feedback)
parts = (action.action_goal.goal, action.action_result.result, action.action_feedback.feedback)
for part in (action, *wholes, *parts):
    globals()[part._type.partition("/")[2]] = type(part)
"""


def install_action(folder: Path, name: str, definition: str) -> str:
    """Install the robot's package with one action; return the folder for the path."""
    package = folder / "robot_actions_pkg" / "msg"
    package.mkdir(parents=True)
    package.with_name("__init__.py").touch()
    code = ACTION_PACKAGE.format(worker=str(WORKERS_FOLDER), name=name, definition=definition)
    (package / "__init__.py").write_text(code)
    return str(folder)
