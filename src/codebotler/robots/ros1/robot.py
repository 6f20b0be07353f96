"""A robot on ROS 1: real actionlib, in a worker of the robot's own Python."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import urlsplit

from codebotler.core.errors import UserError
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros import OTHER_PYTHON, RosRobot, Waits
from codebotler.robots.worker import lacks

WORKER = Path(__file__).with_name("worker")
MASTER = "http://localhost:11311"
NEEDS = ("rospy", "actionlib", "actionlib_msgs", "genpy", "genmsg", "netifaces")
MEND = (
    "apt-get install -y --no-install-recommends python3-rospy python3-actionlib python3-actionlib-msgs "
    "python3-genmsg python3-genpy python3-netifaces python3-rosmaster"
)


class Ros1(RosRobot):
    """A robot on ROS 1.

    Args:
        master: the URI of its master; empty for that of ROS_MASTER_URI.
        python: the interpreter that has its rospy.
        skills: the skills it may be asked to perform.
        speed: of its clock.
        waits: time limits.

    Raises:
        UserError: the URI is invalid.
    """

    def __init__(
        self,
        master: str = "",
        *,
        python: Path = ROS_PYTHON,
        skills: SkillTable = SKILLS,
        speed: float | None = 1.0,
        waits: Waits | None = None,
    ) -> None:
        uri = master_uri(master)
        environment = {"ROS_MASTER_URI": uri}
        super().__init__("ros1", uri, WORKER, python, environment, skills=skills, speed=speed, waits=waits)


def master_uri(address: str = "") -> str:
    """The URI of a master: the given one, that of ROS_MASTER_URI, or the default one.

    Raises:
        UserError: it is not the URI of a master.
    """
    uri = address or os.environ.get("ROS_MASTER_URI") or MASTER
    try:
        parts = urlsplit(uri)
        is_whole = parts.scheme == "http" and bool(parts.hostname) and bool(parts.port)
    except ValueError:  # the port is no number
        is_whole = False
    if not is_whole:
        raise UserError(f'"{uri}" is not the URI of a ROS master; write one such as {MASTER}')
    return uri


def readiness(python: Path = ROS_PYTHON) -> Readiness:
    """Whether the interpreter has rospy and its companions."""
    missing = lacks(python, NEEDS)
    if missing is None:
        return Readiness("ros1", works=False, missing=f"{python} cannot be run", mend=OTHER_PYTHON)
    if missing:
        mend = MEND if python == ROS_PYTHON else OTHER_PYTHON
        return Readiness("ros1", works=False, missing=f"{python} lacks {', '.join(missing)}", mend=mend)
    return Readiness("ros1", works=True, note=f"with {python}; needs a master, see ROS_MASTER_URI")


def robot(options: Options) -> Ros1:
    """The robot of these options."""
    return Ros1(options.address, python=options.ros_python, skills=options.skills, speed=options.speed)
