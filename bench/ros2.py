"""Tests that no goal is lost on ROS 2 while all cores are busy, and measures how much slower goals are then.

A virtual robot on its own ROS graph executes GOALS goals in each of CONNECTIONS connections, while a busy
loop runs on each core. Before that, it does so in ten connections on the idle machine. ROS2_PYTHON is the
path of a Python that has rclpy.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles

from codebotler.core.errors import RobotError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.world import Room, World
from codebotler.robots.base import NotReadyError, Options, RobotLostError
from codebotler.robots.open import open_robot
from codebotler.robots.ros.kinds import choose_python
from codebotler.robots.ros.virtual import VirtualRobot

CONNECTIONS = int(os.environ.get("CONNECTIONS", "200"))
GOALS = int(os.environ.get("GOALS", "10"))
IDLE = 10  # number of connections on the idle machine
PYTHON = Path(os.environ.get("ROS2_PYTHON") or choose_python())
WORLD = World((Room("hall"), Room("kitchen")), "hall")
LOST = (NotReadyError, RobotError, RobotLostError)


class Figures:
    """The times of goals and connections in seconds, and the errors of lost ones."""

    def __init__(self) -> None:
        self.goals: list[float] = []
        self.connections: list[float] = []
        self.lost: list[str] = []

    def connection(self) -> None:
        """Connect, perform goals, and disconnect."""
        skills = SkillTable((SKILLS["say"],))
        robot = open_robot("ros2", Options(ros_python=PYTHON, skills=skills))
        try:
            start = time.perf_counter()
            robot.connect()
            self.connections.append(time.perf_counter() - start)
            for _ in range(GOALS):
                start = time.perf_counter()
                robot.perform("say", ["hello"])
                self.goals.append(time.perf_counter() - start)
        except LOST as error:
            self.lost.append(f"{type(error).__name__}: {error}")
        finally:
            robot.disconnect()


@contextmanager
def busy() -> Iterator[None]:
    """Run a busy loop on each core."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def print_ratios(name: str, idle: list[float], loaded: list[float]) -> None:
    """Print one row of ratios."""
    middle = median(loaded) / median(idle)
    most = quantiles(loaded, n=20)[-1] / quantiles(idle, n=20)[-1]
    print(f"  {name:10} median {middle:4.1f} times   p95 {most:4.1f} times   worst {max(loaded):.2f} s")


def main() -> int:
    """Print all figures. Return 1 if anything was lost."""
    os.environ.setdefault("ROS_DOMAIN_ID", "100")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    virtual = VirtualRobot(WORLD, speed=None, ros=2, python=PYTHON)
    virtual.start()
    idle, loaded = Figures(), Figures()
    try:
        for _ in range(IDLE):
            idle.connection()
        with busy():
            for _ in range(CONNECTIONS):
                loaded.connection()
    finally:
        virtual.stop()
    wanted = CONNECTIONS * GOALS
    print(f"{wanted} goals in {CONNECTIONS} connections on busy cores, {wanted - len(loaded.goals)} lost")
    goal, connection = 1000 * median(idle.goals), median(idle.connections)
    print(f"  idle: a goal {goal:.1f} ms, a connection {connection:.2f} s (median)")
    print("  with a busy loop on each core, compared with the idle machine:")
    print_ratios("goal", idle.goals, loaded.goals)
    print_ratios("connection", idle.connections, loaded.connections)
    for why in idle.lost + loaded.lost:
        print(f"  lost: {why}")
    return int(bool(idle.lost or loaded.lost))


if __name__ == "__main__":
    sys.exit(main())
