"""What does the tool cost above raw actionlib, is any goal lost, and how soon does a stop reach the server?

A virtual robot on a ROS graph of its own executes GOALS times the same skill for actionlib's own client in
the robot's Python, and as often for the tool; in rounds that alternate, since the machine may be busy.
"""

import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles

from codebotler.robots.base import CancelledError
from codebotler.robots.ros import actions_of
from codebotler.robots.ros1 import PYTHON, SCRIPT, Ros1
from codebotler.robots.virtual import VirtualRobot
from codebotler.skills import SKILLS
from codebotler.world import Room, World

GOALS = int(os.environ.get("GOALS", "500"))
ROUNDS = 5
STOPS = 50
OVERHEAD, STOP = 0.005, 0.1
"""What is aimed at, in seconds: the most that a skill may cost more, and a stop may take."""

WORLD = World((Room("hall"), Room("kitchen")), "hall")


def raw(robot: VirtualRobot, goals: int) -> list[float]:
    """The seconds that each goal takes by actionlib's own client."""
    script = str(Path(__file__).with_name("raw_actionlib.py"))
    action = json.dumps(actions_of(SKILLS)["say"])
    done = subprocess.run(
        [str(PYTHON), script, str(SCRIPT.parent), action, str(goals)],
        env={**os.environ, "ROS_MASTER_URI": robot.address},
        stdout=subprocess.PIPE,
        check=True,
    )
    found: list[float] = json.loads(done.stdout.splitlines()[-1])
    return found


def ours(robot: Ros1, goals: int) -> list[float]:
    """The seconds that each goal takes by the tool."""
    took = []
    for _ in range(goals):
        start = time.perf_counter()
        robot.perform("say", ["hello"])
        took.append(time.perf_counter() - start)
    return took


class Heard(VirtualRobot):
    """A virtual robot that notes when it hears of a cancel."""

    heard = threading.Event()
    at = 0.0

    def _cancel(self, number: str) -> None:
        self.at = time.perf_counter()
        self.heard.set()
        super()._cancel(number)


def stops(virtual: Heard, robot: Ros1) -> list[float]:
    """The seconds from each stop to the server's hearing of it."""
    took = []

    def drive(place: str) -> None:
        try:
            robot.perform("go_to", [place])
        except CancelledError:
            return

    for number in range(STOPS):
        robot.connect()
        virtual.heard.clear()
        thread = threading.Thread(target=drive, args=[("kitchen", "hall")[number % 2]])
        thread.start()
        time.sleep(0.05)  # it drives
        start = time.perf_counter()
        robot.cancel()
        if virtual.heard.wait(5):
            took.append(virtual.at - start)
        thread.join()
        virtual.enter(WORLD if number % 2 else World(WORLD.rooms, "kitchen"))
    return took


def told(name: str, took: list[float]) -> None:
    """Print one row."""
    ms = [1000 * seconds for seconds in took]
    most = quantiles(ms, n=20)[-1]
    print(f"  {name:18} median {median(ms):6.2f} ms   p95 {most:6.2f} ms   worst {max(ms):7.2f} ms")


@contextmanager
def on_a_graph(*, speed: float | None) -> Iterator[tuple[Heard, Ros1]]:
    """A virtual robot with a master of its own, and the tool's robot, connected to it."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    virtual = Heard(WORLD, speed=speed, port=port)
    robot = Ros1(virtual.address)
    try:
        virtual.start()
        robot.connect()
        yield virtual, robot
    finally:
        robot.disconnect()
        virtual.stop()


def main() -> int:
    """Print all figures; 1 if what is aimed at is missed."""
    os.environ["ROS_HOSTNAME"] = "localhost"
    plain: list[float] = []
    through: list[float] = []
    with tempfile.TemporaryDirectory() as home:
        os.environ["ROS_HOME"], os.environ["ROS_LOG_DIR"] = home, home
        with on_a_graph(speed=None) as (virtual, robot):
            ours(robot, 20)
            for _ in range(ROUNDS):
                plain += raw(virtual, GOALS // ROUNDS)
                through += ours(robot, GOALS // ROUNDS)
        with on_a_graph(speed=0.01) as (virtual, robot):
            reached = stops(virtual, robot)
    more = median(through) - median(plain)
    print(f"{len(through)} goals in a row, {GOALS - len(through)} lost")
    told("raw actionlib", plain)
    told("through the tool", through)
    print(f"  a skill costs {1000 * more:.2f} ms more (median; aim: under {1000 * OVERHEAD:g} ms)")
    print(f"{len(reached)} stops of {STOPS} reached the action server (aim: worst under {1000 * STOP:g} ms)")
    told("stop", reached)
    return int(more >= OVERHEAD or len(through) < GOALS or len(reached) < STOPS or max(reached) >= STOP)


if __name__ == "__main__":
    sys.exit(main())
