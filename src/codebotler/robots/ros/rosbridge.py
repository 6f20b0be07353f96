"""A robot behind a rosbridge server, which gives access to ROS over a websocket. It needs no ROS here."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from codebotler.robots.base import Options
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.robot import RosRobot

ROSBRIDGE_ADDRESS = "ws://localhost:9090"


def robot(options: Options, waits: Timeouts | None = None) -> RosRobot:
    """Create a robot behind a rosbridge, by default on this machine. The worker uses CodeBotler's Python."""
    options = replace(options, ros_python=Path(sys.executable))
    address = options.address or ROSBRIDGE_ADDRESS
    return RosRobot("rosbridge", address, "rosbridge_worker.py", options, {}, waits=waits)
