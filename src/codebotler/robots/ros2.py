"""A robot on ROS 2: rclpy, in a worker of the robot's own Python.

It was tested against a stand-in for rclpy only, never on a ROS 2 graph: none was at hand.
"""

from __future__ import annotations

import os
from pathlib import Path

from codebotler.badinput import BadInput
from codebotler.robots.base import Options, Readiness
from codebotler.robots.ros import Ros, RosRobot, Waits
from codebotler.robots.worker import lacks
from codebotler.skills import SKILLS, SkillTable

SCRIPT = Path(__file__).with_name("ros2_worker.py")
PYTHON = Path("/usr/bin/python3")
NEEDS = ("rclpy", "action_msgs", "robot_actions_pkg")
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
        ros = Ros("ros2", SCRIPT, python, {"ROS_DOMAIN_ID": address}, address)
        super().__init__(ros, skills, speed, waits)


def readiness(python: Path = PYTHON) -> Readiness:
    """Whether the interpreter has rclpy and the robot's actions."""
    missing = lacks(python, NEEDS)
    mend = "source the setup.bash of ROS 2 and of the workspace with robot_actions_pkg"
    if missing is None:
        return Readiness("ros2", works=False, missing=f"{python} cannot be run", mend=mend, note=NOTE)
    if missing:
        lacking = f"{python} lacks {', '.join(missing)}"
        return Readiness("ros2", works=False, missing=lacking, mend=mend, note=NOTE)
    return Readiness("ros2", works=True, note=NOTE)


def robot(options: Options) -> Ros2:
    """The robot that a user means.

    Raises:
        BadInput: the address is no domain.
    """
    if options.address and not options.address.isdecimal():
        raise BadInput(f'"{options.address}" is no ROS_DOMAIN_ID; write a number such as 0')
    return Ros2(options.address, python=options.ros_python, skills=options.skills, speed=options.speed)
