"""A robot on ROS 1: real actionlib, in a worker of the robot's own Python."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import urlsplit

from codebotler.core.errors import UserError
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros.classes import class_for
from codebotler.robots.ros.robot import OTHER_PYTHON, RosRobot, Waits, ros_readiness

MASTER = "http://localhost:11311"
NEEDS = ("rospy", "actionlib", "actionlib_msgs", "genpy", "genmsg", "netifaces")
MEND = (
    "apt-get install -y --no-install-recommends python3-rospy python3-actionlib python3-actionlib-msgs "
    "python3-genmsg python3-genpy python3-netifaces python3-rosmaster"
)


def robot(options: Options, waits: Waits | None = None) -> RosRobot:
    """A robot on ROS 1, not yet connected.

    Args:
        options: with the URI of its master as the address; empty for that of ROS_MASTER_URI.
        waits: time limits.

    Raises:
        UserError: the URI is invalid.
    """
    uri = master_uri(options.address)
    return class_for(options)("ros1", uri, "ros1_worker.py", options, {"ROS_MASTER_URI": uri}, waits=waits)


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
    mend = MEND if python == ROS_PYTHON else OTHER_PYTHON
    note = f"with {python}; needs a master, see ROS_MASTER_URI"
    return ros_readiness("ros1", python, NEEDS, lambda _: mend, note)
