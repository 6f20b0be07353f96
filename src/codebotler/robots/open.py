"""Open a robot by its kind, such as `ros2`, and check which kinds work on this machine."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from codebotler.core.errors import UserError, install_command
from codebotler.core.text.unicode import compose
from codebotler.robots.base import (
    ROS_PYTHON,
    Feedback,
    Options,
    Readiness,
    Robot,
    RobotArgument,
    RobotResult,
    ignore_feedback,
)
from codebotler.robots.face import Face, RobotWithFace, without_speech
from codebotler.robots.own import OwnRobot, is_own

ROBOT_KINDS = {
    "sim": "simulated:Simulated.open",
    "pyrobosim": "pyrobosim.robot:Pyrobosim.open",
    "ros1": "ros.kinds:ros1",
    "rosbridge": "ros.kinds:rosbridge",
    "ros2": "ros.kinds:ros2",
}
"""The function that opens each kind of robot, as MODULE:NAME. These modules must import quickly."""
PACKAGES = {"pyrobosim": "pyrobosim", "rosbridge": "websockets"}
"""The optional package that a kind of robot needs."""
NOTES = {
    "sim": "simulates the rooms and people of --world FILE",
    "pyrobosim": "plans and drives through --world FILE, without a window",
    "rosbridge": "at --address, ws://localhost:9090 by default; with ROS 2, tested only against a simulated "
    "rosbridge",
}
"""Advice for users, for each kind of robot that needs no ROS on this machine."""


def open_robot(name: str, options: Options | None = None) -> Robot:
    """Open a robot without connecting it.

    `name` is a kind (sim, pyrobosim, ros1, rosbridge or ros2) or a class in a file, as in lab_robot.py:Spot.

    Raises:
        UserError: the kind or class does not exist, a package is missing, or an option is invalid.
    """
    if is_own(name):
        return SpellingRobot(OwnRobot(name, options or Options()))
    if name not in ROBOT_KINDS:
        own = "or your own class, such as lab_robot.py:Spot"
        raise UserError(f'unknown robot "{name}"; choose one of {", ".join(ROBOT_KINDS)}, {own}')
    if package := _missing_package(name):
        raise UserError(f"{package} is not installed; `{install_command(package)}` installs it")
    robot: Robot = resolve_name(f"{__package__}.{ROBOT_KINDS[name]}")(options or Options())
    return robot if name == "sim" else SpellingRobot(robot)


def open_with_face(name: str, options: Options, face: Face) -> Robot:
    """Open a robot whose spoken skills, such as `say` and `ask`, are performed on the screens of `face`."""
    silent = open_robot(name, replace(options, skills=without_speech(options.skills)))
    lacking = without_speech(options.skills).without(silent.skills)
    return RobotWithFace(silent, face, options.skills.without(lacking))


def list_readiness(ros_python: Path = ROS_PYTHON) -> list[Readiness]:
    """Check which kinds of robots work on this machine. `ros_python` is the interpreter that has ROS."""
    return [_readiness(name, ros_python) for name in ROBOT_KINDS]


def _readiness(name: str, ros_python: Path) -> Readiness:
    if package := _missing_package(name):
        missing, mend = f"{package} is not installed", install_command(package)
        return Readiness(name, works=False, missing=missing, mend=mend)
    if name in NOTES:
        return Readiness(name, works=True, note=NOTES[name])
    from codebotler.robots.ros.kinds import ros_readiness  # noqa: PLC0415 - only where ROS is asked for

    return ros_readiness(name, ros_python)


def _missing_package(name: str) -> str:
    package = PACKAGES.get(name)
    return package if package and importlib.util.find_spec(package) is None else ""


class SpellingRobot:
    """Wraps a robot so that programs see `é` as one character, even if the robot writes `e` and an accent."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._spellings: dict[str, str] = {}  # the robot's spelling of each composed name

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute of the robot
        return getattr(self._robot, name)

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Perform a skill, with names in the robot's spelling. Return its result in composed form (NFC)."""
        given = [self._spellings.get(one, one) if isinstance(one, str) else one for one in arguments]
        result = self._robot.perform(skill, given, feedback)
        for text in result if isinstance(result, list) else [result]:
            if isinstance(text, str) and compose(text) != text:
                self._spellings[compose(text)] = text
        return compose(result)
