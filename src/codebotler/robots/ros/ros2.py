"""A robot on ROS 2, whose worker runs rclpy under the system's Python or under CodeBotler's own."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros.caller import Timeouts, ros_readiness
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.worker import find_missing

ROS2_MODULES = ("rclpy", "action_msgs", "sensor_msgs")
INSTALL_ROS2 = "pip install 'codebotler[ros2]'"


def robot(options: Options, waits: Timeouts | None = None) -> RosRobot:
    """Create a robot on ROS 2. Its address is a domain number, by default ROS_DOMAIN_ID or else 0."""
    domain = domain_of(options.address)
    options = replace(options, ros_python=choose_python(options.ros_python))
    variables = {"ROS_DOMAIN_ID": domain}
    return RosRobot("ros2", domain, "ros2_worker.py", options, variables, waits=waits)


def domain_of(address: str = "") -> str:
    """Return the given domain, or else ROS_DOMAIN_ID, or else 0. Raise UserError if it is not a number."""
    domain = address or os.environ.get("ROS_DOMAIN_ID") or "0"
    if not domain.isdecimal():
        raise UserError(f'"{domain}" is not a ROS_DOMAIN_ID; write a number such as 0')
    return domain


def choose_python(named: Path = ROS_PYTHON) -> Path:
    """Return the interpreter the user named, the system's if it has ROS 2, or else CodeBotler's own."""
    if named != ROS_PYTHON or find_spec("rclpy") is None:
        return named
    return named if find_missing(named, ROS2_MODULES) == [] else Path(sys.executable)


def readiness(python: Path = ROS_PYTHON) -> Readiness:
    """Check whether the interpreter has rclpy. Missing message types are built later."""
    python = choose_python(python)
    return ros_readiness("ros2", python, ROS2_MODULES, find_fix(), f"with {python}; see ROS_DOMAIN_ID")


def find_fix(installed: Path = Path("/opt/ros")) -> str:
    """Return the command that makes ROS 2 available: sourcing an installed ROS 2, or else installing it."""
    setups = sorted(path for path in installed.glob("*/setup.bash") if (path.parent / "share/rclpy").is_dir())
    return f"source {setups[-1]}" if setups else INSTALL_ROS2
