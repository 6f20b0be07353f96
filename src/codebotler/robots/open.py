"""Opens a robot by its kind, and tells which kinds work on this machine."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import cast

from codebotler.core.errors import UserError, install_command, missing_package
from codebotler.robots.base import ROS_PYTHON, Options, Readiness, Robot
from codebotler.robots.face import Face, RobotWithFace, without_speech
from codebotler.robots.own import OwnRobot, is_own
from codebotler.robots.spelling import SpellingRobot

KINDS = {
    "sim": "simulated",
    "pyrobosim": "pyrobosim.robot",
    "ros1": "ros.ros1",
    "rosbridge": "ros.rosbridge",
    "ros2": "ros.ros2",
}
"""Kinds of robots as a user names them, with the module of each.

Importing such a module is cheap. It has `readiness(ros_python)`, which takes less than a second, and
`robot(options)`, which gives a robot that is not yet connected.
"""


def open_robot(name: str, options: Options | None = None) -> Robot:
    """A robot by its kind (sim, pyrobosim, ros1, rosbridge or ros2) or class, not yet connected.

    Raises:
        UserError: there is no such kind or class, or an option is missing or wrong.
    """
    if is_own(name):
        return _spelling(OwnRobot(name, options or Options()))
    if name not in KINDS:
        own = "or a class of yours, as in lab_robot.py:Spot"
        raise UserError(f'there is no robot "{name}"; choose one of {", ".join(KINDS)}, {own}')
    robot: Robot = _kind(name).robot(options or Options())
    return robot if name == "sim" else _spelling(robot)


def _spelling(robot: Robot) -> Robot:
    return cast("Robot", SpellingRobot(robot))


def open_with_face(name: str, options: Options, face: Face) -> Robot:
    """The same with a face, so that the robot itself needs neither `say` nor `ask`."""
    silent = open_robot(name, replace(options, skills=without_speech(options.skills)))
    lacking = without_speech(options.skills).without(silent.skills)
    return RobotWithFace(silent, face, options.skills.without(lacking))


def all_readiness(ros_python: Path = ROS_PYTHON) -> list[Readiness]:
    """Whether each kind of robot can be used here, and what is missing if not."""
    return [_readiness(name, ros_python) for name in KINDS]


def _readiness(name: str, ros_python: Path) -> Readiness:
    try:
        readiness: Readiness = _kind(name).readiness(ros_python)
    except ModuleNotFoundError as error:
        package = missing_package(error)
        if not package:
            raise
        missing, mend = f"{package} is not installed", install_command(package)
        return Readiness(name, works=False, missing=missing, mend=mend)
    return readiness


def _kind(name: str) -> ModuleType:
    return importlib.import_module(f"{__package__}.{KINDS[name]}")
