"""A robot on ROS 2: rclpy, in a worker of the robot's own Python, or of ours if that has rclpy."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros.classes import class_for
from codebotler.robots.ros.robot import RosRobot, Waits, ros_readiness
from codebotler.robots.ros.worker import lacks

NEEDS = ("rclpy", "action_msgs", "sensor_msgs")
INSTALL = "pip install 'codebotler[ros2]'"


def robot(options: Options, waits: Waits | None = None) -> RosRobot:
    """A robot on ROS 2; its address is a domain, by default that of ROS_DOMAIN_ID, or 0."""
    domain = domain_of(options.address)
    options = replace(options, ros_python=python_of(options.ros_python))
    variables = {"ROS_DOMAIN_ID": domain}
    return class_for(options)("ros2", domain, "ros2_worker.py", options, variables, waits=waits)


def domain_of(address: str = "") -> str:
    """The number of a domain: the given one, that of ROS_DOMAIN_ID, or 0.

    Raises:
        UserError: it is no number.
    """
    domain = address or os.environ.get("ROS_DOMAIN_ID") or "0"
    if not domain.isdecimal():
        raise UserError(f'"{domain}" is not a ROS_DOMAIN_ID; write a number such as 0')
    return domain


def python_of(named: Path = ROS_PYTHON) -> Path:
    """The interpreter that is named; by default the system's, if ROS 2 is sourced there, or else ours."""
    if named != ROS_PYTHON or find_spec("rclpy") is None:
        return named
    return named if lacks(named, NEEDS) == [] else Path(sys.executable)


def readiness(python: Path = ROS_PYTHON) -> Readiness:
    """Whether the interpreter has rclpy; actions are built where they are missing."""
    python = python_of(python)
    return ros_readiness("ros2", python, NEEDS, mend_of, f"with {python}; see ROS_DOMAIN_ID")


def mend_of(_missing: Sequence[str], installed: Path = Path("/opt/ros")) -> str:
    """The command that gives an interpreter its missing modules of ROS 2."""
    setups = sorted(path for path in installed.glob("*/setup.bash") if (path.parent / "share/rclpy").is_dir())
    return f"source {setups[-1]}" if setups else INSTALL
