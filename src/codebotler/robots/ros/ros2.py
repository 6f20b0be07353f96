"""A robot on ROS 2: rclpy, in a worker of the robot's own Python; tested against a stand-in only."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros.robot import RosRobot, Waits, ros_readiness

NEEDS = ("rclpy", "action_msgs", "robot_actions_pkg")
INSTALL = "apt-get install -y ros-jazzy-ros-base && source /opt/ros/jazzy/setup.bash"
BUILD = "cd ~/ros2_ws && colcon build --packages-select robot_actions_pkg && source install/setup.bash"
NOTE = "tested against a stand-in for rclpy only, never on a ROS 2 graph"


def robot(options: Options, waits: Waits | None = None) -> RosRobot:
    """A robot on ROS 2; its address is a domain, by default that of ROS_DOMAIN_ID, or 0."""
    domain = options.address or os.environ.get("ROS_DOMAIN_ID") or "0"
    if not domain.isdecimal():
        raise UserError(f'"{domain}" is not a ROS_DOMAIN_ID; write a number such as 0')
    return RosRobot("ros2", domain, "ros2_worker.py", options, {"ROS_DOMAIN_ID": domain}, waits=waits)


def readiness(python: Path = ROS_PYTHON) -> Readiness:
    """Whether the interpreter has rclpy and the robot's actions."""
    return ros_readiness("ros2", python, NEEDS, mend_of, NOTE)


def mend_of(missing: Sequence[str], installed: Path = Path("/opt/ros")) -> str:
    """The command that gives an interpreter its missing modules of ROS 2."""
    if set(missing) == {"robot_actions_pkg"}:
        return BUILD
    setups = sorted(path for path in installed.glob("*/setup.bash") if (path.parent / "share/rclpy").is_dir())
    return f"source {setups[-1]}" if setups else INSTALL
