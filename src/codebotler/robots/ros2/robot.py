"""A robot on ROS 2: rclpy, in a worker of the robot's own Python; tested against a stand-in only."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros import OTHER_PYTHON, RosRobot, Waits
from codebotler.robots.worker import lacks

WORKER = Path(__file__).with_name("worker.py")
NEEDS = ("rclpy", "action_msgs", "robot_actions_pkg")
INSTALL = "apt-get install -y ros-jazzy-ros-base && source /opt/ros/jazzy/setup.bash"
BUILD = "cd ~/ros2_ws && colcon build --packages-select robot_actions_pkg && source install/setup.bash"
NOTE = "tested against a stand-in for rclpy only, never on a ROS 2 graph"


class Ros2(RosRobot):
    """A robot on ROS 2; its domain is that of ROS_DOMAIN_ID, or 0, unless one is given."""

    def __init__(
        self,
        domain: str = "",
        *,
        python: Path = ROS_PYTHON,
        skills: SkillTable = SKILLS,
        speed: float | None = 1.0,
        waits: Waits | None = None,
    ) -> None:
        address = domain or os.environ.get("ROS_DOMAIN_ID") or "0"
        environment = {"ROS_DOMAIN_ID": address}
        super().__init__(
            "ros2", address, WORKER, python, environment, skills=skills, speed=speed, waits=waits
        )


def readiness(python: Path = ROS_PYTHON) -> Readiness:
    """Whether the interpreter has rclpy and the robot's actions."""
    missing = lacks(python, NEEDS)
    if missing is None:
        return Readiness("ros2", works=False, missing=f"{python} cannot be run", mend=OTHER_PYTHON, note=NOTE)
    if missing:
        lacking = f"{python} lacks {', '.join(missing)}"
        return Readiness("ros2", works=False, missing=lacking, mend=mend_of(missing), note=NOTE)
    return Readiness("ros2", works=True, note=NOTE)


def mend_of(missing: Sequence[str], installed: Path = Path("/opt/ros")) -> str:
    """The command that gives an interpreter its missing modules of ROS 2."""
    if set(missing) == {"robot_actions_pkg"}:
        return BUILD
    setups = sorted(path for path in installed.glob("*/setup.bash") if (path.parent / "share/rclpy").is_dir())
    return f"source {setups[-1]}" if setups else INSTALL


def robot(options: Options) -> Ros2:
    """The robot of these options."""
    if options.address and not options.address.isdecimal():
        raise UserError(f'"{options.address}" is not a ROS_DOMAIN_ID; write a number such as 0')
    return Ros2(options.address, python=options.ros_python, skills=options.skills, speed=options.speed)
