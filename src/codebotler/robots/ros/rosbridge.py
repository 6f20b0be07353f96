"""A robot behind a rosbridge server, which gives access to ROS over a websocket. It needs no ROS here."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.robot import RosRobot

ROSBRIDGE_ADDRESS = "ws://localhost:9090"
ROSBRIDGE_NOTE = "with ROS 2, tested only against a simulated rosbridge"


def robot(options: Options, waits: Timeouts | None = None) -> RosRobot:
    """Create a robot behind a rosbridge, by default on this machine. The worker uses CodeBotler's Python."""
    readiness()
    options = replace(options, ros_python=Path(sys.executable))
    address = options.address or ROSBRIDGE_ADDRESS
    return RosRobot("rosbridge", address, "rosbridge_worker.py", options, {}, waits=waits)


def readiness(_ros_python: Path = ROS_PYTHON) -> Readiness:
    """Report rosbridge as available, or raise ModuleNotFoundError if websockets is not installed."""
    if find_spec("websockets") is None:
        raise ModuleNotFoundError("websockets is not installed", name="websockets")
    return Readiness(
        "rosbridge", works=True, note=f"at --address, {ROSBRIDGE_ADDRESS} by default; {ROSBRIDGE_NOTE}"
    )
