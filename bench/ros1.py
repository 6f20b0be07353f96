"""Measures the overhead of the tool compared with raw actionlib, and tests that no goal is lost.

A virtual robot on its own ROS graph executes the same skill GOALS times for actionlib's own client in the
robot's Python, and as often for the tool. The two take turns, because the machine may be busy.
"""

import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles

from codebotler.core.skills.paper import SKILLS
from codebotler.core.world import Room, World
from codebotler.robots.base import ROS_PYTHON, Options, Robot
from codebotler.robots.open import open_robot
from codebotler.robots.ros.caller import calls_data
from codebotler.robots.ros.connections.connection import default_connection
from codebotler.robots.ros.virtual import VirtualRobot
from codebotler.robots.ros.worker import WORKERS_FOLDER

GOALS = int(os.environ.get("GOALS", "500"))
ROUNDS = 5
OVERHEAD = 0.005
"""The target: the overhead of a skill is less than this, in seconds."""

WORLD = World((Room("hall"), Room("kitchen")), "hall")


def raw(robot: VirtualRobot, goals: int) -> list[float]:
    """Return the seconds that each goal takes with actionlib's own client."""
    script = str(Path(__file__).with_name("raw_actionlib.py"))
    action = json.dumps(calls_data(default_connection(SKILLS))["say"])
    done = subprocess.run(
        [str(ROS_PYTHON), script, str(WORKERS_FOLDER), action, str(goals)],
        env={**os.environ, "ROS_MASTER_URI": robot.address},
        stdout=subprocess.PIPE,
        check=True,
    )
    found: list[float] = json.loads(done.stdout.splitlines()[-1])
    return found


def ours(robot: Robot, goals: int) -> list[float]:
    """Return the seconds that each goal takes with the tool."""
    took = []
    for _ in range(goals):
        start = time.perf_counter()
        robot.perform("say", ["hello"])
        took.append(time.perf_counter() - start)
    return took


def print_row(name: str, took: list[float]) -> None:
    """Print one row of figures."""
    ms = [1000 * seconds for seconds in took]
    most = quantiles(ms, n=20)[-1]
    print(f"  {name:18} median {median(ms):6.2f} ms   p95 {most:6.2f} ms   worst {max(ms):7.2f} ms")


@contextmanager
def connect_on_graph() -> Iterator[tuple[VirtualRobot, Robot]]:
    """Yield a virtual robot with its own ROS master, and the tool's robot, which is connected to it."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    virtual = VirtualRobot(WORLD, speed=None, address=f"http://localhost:{port}")
    robot = open_robot("ros1", Options(address=virtual.address))
    try:
        virtual.start()
        robot.connect()
        yield virtual, robot
    finally:
        robot.disconnect()
        virtual.stop()


def main() -> int:
    """Print all figures. Return 1 if the target is missed."""
    os.environ["ROS_HOSTNAME"] = "localhost"
    plain: list[float] = []
    through: list[float] = []
    with tempfile.TemporaryDirectory() as home:
        os.environ["ROS_HOME"], os.environ["ROS_LOG_DIR"] = home, home
        with connect_on_graph() as (virtual, robot):
            ours(robot, 20)
            for _ in range(ROUNDS):
                plain += raw(virtual, GOALS // ROUNDS)
                through += ours(robot, GOALS // ROUNDS)
    more = median(through) - median(plain)
    print(f"{len(through)} goals in a row, {GOALS - len(through)} lost")
    print_row("raw actionlib", plain)
    print_row("through the tool", through)
    print(f"  a skill costs {1000 * more:.2f} ms more (median; target: under {1000 * OVERHEAD:g} ms)")
    return int(more >= OVERHEAD or len(through) < GOALS)


if __name__ == "__main__":
    sys.exit(main())
