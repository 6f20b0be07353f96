"""A robot on ROS 1, whose worker runs actionlib under the robot's Python."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import urlsplit

from codebotler.core.errors import UserError
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros.caller import USE_OTHER_PYTHON, Timeouts, ros_readiness
from codebotler.robots.ros.robot import RosRobot

MASTER_URI = "http://localhost:11311"
ROS1_MODULES = ("rospy", "actionlib", "actionlib_msgs", "genpy", "genmsg", "netifaces")
INSTALL_ROS1 = (
    "apt-get install -y --no-install-recommends python3-rospy python3-actionlib python3-actionlib-msgs "
    "python3-genmsg python3-genpy python3-netifaces python3-rosmaster"
)


def robot(options: Options, waits: Timeouts | None = None) -> RosRobot:
    """Create a robot on ROS 1. Its address is the URI of a master, by default ROS_MASTER_URI."""
    uri = master_uri(options.address)
    return RosRobot("ros1", uri, "ros1_worker.py", options, {"ROS_MASTER_URI": uri}, waits=waits)


def master_uri(address: str = "") -> str:
    """Return the given master URI, ROS_MASTER_URI, or the default. Raise UserError if it is invalid."""
    uri = address or os.environ.get("ROS_MASTER_URI") or MASTER_URI
    try:
        parts = urlsplit(uri)
        is_valid = parts.scheme == "http" and bool(parts.hostname) and bool(parts.port)
    except ValueError:  # for an invalid port
        is_valid = False
    if not is_valid:
        raise UserError(f'"{uri}" is not the URI of a ROS master; write one such as {MASTER_URI}')
    return uri


def readiness(python: Path = ROS_PYTHON) -> Readiness:
    """Check whether the interpreter has rospy and the other modules that the worker needs."""
    mend = INSTALL_ROS1 if python == ROS_PYTHON else USE_OTHER_PYTHON
    note = f"with {python}; needs a master, see ROS_MASTER_URI"
    return ros_readiness("ros1", python, ROS1_MODULES, mend, note)
