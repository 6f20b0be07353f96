"""The three kinds of robots on ROS: how each is reached, and what it needs on this machine."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit

from codebotler.core.errors import UserError
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros.caller import Timeouts
from codebotler.robots.ros.robot import RosRobot
from codebotler.robots.ros.worker import find_missing

MASTER_URI = "http://localhost:11311"
ROSBRIDGE_ADDRESS = "ws://localhost:9090"
ROS1_MODULES = ("rospy", "actionlib", "actionlib_msgs", "genpy", "genmsg", "netifaces")
ROS2_MODULES = ("rclpy", "action_msgs", "sensor_msgs")
INSTALL_ROS1 = (
    "apt-get install -y --no-install-recommends python3-rospy python3-actionlib python3-actionlib-msgs "
    "python3-genmsg python3-genpy python3-netifaces python3-rosmaster"
)
INSTALL_ROS2 = "pip install 'codebotler[ros2]'"


def ros1(options: Options, waits: Timeouts | None = None) -> RosRobot:
    """Create a robot on ROS 1. Its worker process uses actionlib and runs under the robot's Python.

    The address is the URI of a ROS master, by default ROS_MASTER_URI. Raise UserError if it is invalid.
    """
    uri = master_uri(options.address)
    return RosRobot("ros1", uri, "ros1_worker.py", options, {"ROS_MASTER_URI": uri}, waits=waits)


def ros2(options: Options, waits: Timeouts | None = None) -> RosRobot:
    """Create a robot on ROS 2. Its worker process uses rclpy, under the robot's or CodeBotler's Python.

    The address is a domain number, by default ROS_DOMAIN_ID or 0. Raise UserError if it is not a number.
    """
    domain = domain_of(options.address)
    options = replace(options, ros_python=choose_python(options.ros_python))
    return RosRobot("ros2", domain, "ros2_worker.py", options, {"ROS_DOMAIN_ID": domain}, waits=waits)


def rosbridge(options: Options, waits: Timeouts | None = None) -> RosRobot:
    """Create a robot behind a rosbridge server, which gives access to ROS over a websocket.

    Its worker needs no ROS on this machine. The default address is ws://localhost:9090.
    """
    options = replace(options, ros_python=Path(sys.executable))
    address = options.address or ROSBRIDGE_ADDRESS
    return RosRobot("rosbridge", address, "rosbridge_worker.py", options, {}, waits=waits)


def master_uri(address: str = "") -> str:
    """Return `address`, or else ROS_MASTER_URI, or else the default URI. Raise UserError if it is invalid."""
    uri = address or os.environ.get("ROS_MASTER_URI") or MASTER_URI
    try:
        parts = urlsplit(uri)
        is_valid = parts.scheme == "http" and bool(parts.hostname) and bool(parts.port)
    except ValueError:  # for an invalid port
        is_valid = False
    if not is_valid:
        raise UserError(f'"{uri}" is not the URI of a ROS master; write one such as {MASTER_URI}')
    return uri


def domain_of(address: str = "") -> str:
    """Return the ROS 2 domain: `address`, ROS_DOMAIN_ID or else 0. Raise UserError if it is not a number."""
    domain = address or os.environ.get("ROS_DOMAIN_ID") or "0"
    if not domain.isdecimal():
        raise UserError(f'"{domain}" is not a ROS_DOMAIN_ID; write a number such as 0')
    return domain


def choose_python(named: Path = ROS_PYTHON) -> Path:
    """Return the Python for ROS 2: `named`, or our own if `named` is the default and only our own has it."""
    if named != ROS_PYTHON or find_spec("rclpy") is None:
        return named
    return named if find_missing(named, ROS2_MODULES) == [] else Path(sys.executable)


def ros_readiness(name: str, python: Path = ROS_PYTHON) -> Readiness:
    """Check whether `python` has the modules for `name` (ros1 or ros2). Message types are not checked."""
    if name == "ros1":
        needs: Sequence[str] = ROS1_MODULES
        mend, see = INSTALL_ROS1, "needs a master, see ROS_MASTER_URI"
    else:
        python = choose_python(python)
        needs, mend, see = ROS2_MODULES, find_fix(), "see ROS_DOMAIN_ID"
    missing, note = find_missing(python, needs), f"with {python}; {see}"
    if missing == []:
        return Readiness(name, works=True, note=note)
    lacking = "cannot be run" if missing is None else f"lacks {', '.join(missing)}"
    return Readiness(name, works=False, missing=f"{python} {lacking}", mend=mend, note=note)


def find_fix(installed: Path = Path("/opt/ros")) -> str:
    """Return the command that makes ROS 2 available: source an installed version, or else install one."""
    setups = sorted(path for path in installed.glob("*/setup.bash") if (path.parent / "share/rclpy").is_dir())
    return f"source {setups[-1]}" if setups else INSTALL_ROS2
