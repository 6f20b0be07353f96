"""A robot behind a rosbridge: ROS over a websocket, with nothing of ROS on this machine."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros.classes import class_for
from codebotler.robots.ros.robot import RosRobot, Waits

ADDRESS = "ws://localhost:9090"
NOTE = "robots of ROS 2 behind it were tested against a stand-in for the protocol only"


def robot(options: Options, waits: Waits | None = None) -> RosRobot:
    """A robot behind a rosbridge, by default one on this machine; its worker runs under our own Python."""
    readiness()
    ours = replace(options, ros_python=Path(sys.executable))
    address = options.address or ADDRESS
    return class_for(options)("rosbridge", address, "rosbridge_worker.py", ours, {}, waits=waits)


def readiness(_ros_python: Path = ROS_PYTHON) -> Readiness:
    """It needs websockets, which would else be missed by its worker only."""
    if find_spec("websockets") is None:
        raise ModuleNotFoundError("websockets is not installed", name="websockets")
    return Readiness("rosbridge", works=True, note=f"at --address, {ADDRESS} by default; {NOTE}")
