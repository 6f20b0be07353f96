"""A robot on ROS 2: rclpy, in a worker of the robot's own Python.

It was tested against a stand-in for rclpy only, never on a ROS 2 graph: none was at hand.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from codebotler.core.errors import UserError
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.robots.base import Options, Readiness
from codebotler.robots.ros import OTHER_PYTHON, PYTHON, Ros, RosRobot, Waits
from codebotler.robots.worker import lacks

WORKER = Path(__file__).with_name("worker.py")
NEEDS = ("rclpy", "action_msgs", "robot_actions_pkg")
INSTALL = "apt-get install -y ros-jazzy-ros-base && source /opt/ros/jazzy/setup.bash"
BUILD = "cd ~/ros2_ws && colcon build --packages-select robot_actions_pkg && source install/setup.bash"
NOTE = "tested against a stand-in for rclpy only, never on a ROS 2 graph"


class Ros2(RosRobot):
    """A robot on ROS 2.

    Args:
        domain: its ROS_DOMAIN_ID; empty for that of the environment, or 0.
        python: the interpreter that has its rclpy and robot_actions_pkg.
        skills: what it can be asked to do.
        speed: of its clock.
        waits: for how long what is waited for.
    """

    def __init__(
        self,
        domain: str = "",
        *,
        python: Path = PYTHON,
        skills: SkillTable = SKILLS,
        speed: float | None = 1.0,
        waits: Waits | None = None,
    ) -> None:
        address = domain or os.environ.get("ROS_DOMAIN_ID") or "0"
        ros = Ros("ros2", WORKER, python, {"ROS_DOMAIN_ID": address}, address)
        super().__init__(ros, skills, speed, waits)


def readiness(python: Path = PYTHON) -> Readiness:
    """Whether the interpreter has rclpy and the robot's actions."""
    missing = lacks(python, NEEDS)
    if missing is None:
        return Readiness("ros2", works=False, missing=f"{python} cannot be run", mend=OTHER_PYTHON, note=NOTE)
    if missing:
        lacking = f"{python} lacks {', '.join(missing)}"
        return Readiness("ros2", works=False, missing=lacking, mend=mend_of(missing), note=NOTE)
    return Readiness("ros2", works=True, note=NOTE)


def mend_of(missing: Sequence[str], installed: Path = Path("/opt/ros")) -> str:
    """The command that gives an interpreter the modules of ROS 2 that it lacks.

    Args:
        missing: their names.
        installed: where the versions of ROS lie.
    """
    if set(missing) == {"robot_actions_pkg"}:
        return BUILD
    setups = sorted(path for path in installed.glob("*/setup.bash") if (path.parent / "share/rclpy").is_dir())
    return f"source {setups[-1]}" if setups else INSTALL


def robot(options: Options) -> Ros2:
    """The robot that a user means.

    Raises:
        UserError: the address is no domain.
    """
    if options.address and not options.address.isdecimal():
        raise UserError(f'"{options.address}" is no ROS_DOMAIN_ID; write a number such as 0')
    return Ros2(options.address, python=options.ros_python, skills=options.skills, speed=options.speed)
