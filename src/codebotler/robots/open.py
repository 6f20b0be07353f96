"""From the name of a kind of robot to the robot."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Protocol, cast

from codebotler.core.errors import UserError
from codebotler.robots.base import Options, Readiness, Robot
from codebotler.robots.face import Face
from codebotler.robots.faced import Faced, unspoken

KINDS = {
    "sim": "simulated",
    "pyrobosim": "pyrobosim.robot",
    "ros1": "ros1.robot",
    "rosbridge": "rosbridge.robot",
    "ros2": "ros2.robot",
}
"""Kinds of robots as a user names them, with the module of each."""

OF_A_PYTHON = frozenset({"ros1", "ros2"})
"""Kinds that need an interpreter to which ROS belongs."""

ABSENT = "it is not part of this version"


class Kind(Protocol):
    """A module about one kind of robot; importing it takes nothing heavy."""

    def readiness(self) -> Readiness:
        """Whether such robots can be used here; takes less than a second and changes nothing."""

    def robot(self, options: Options) -> Robot:
        """The robot that a user means, not yet connected.

        Raises:
            UserError: what the user says of it is missing or wrong.
        """


class RosKind(Protocol):
    """A module about one kind of robot that has a worker."""

    def readiness(self, python: Path) -> Readiness:
        """Whether such robots can be used with an interpreter; takes less than a second."""


def open_robot(name: str, options: Options | None = None) -> Robot:
    """The robot that a user means, not yet connected.

    Args:
        name: of the kind: sim, pyrobosim, ros1, rosbridge or ros2.
        options: what the user says about it.

    Raises:
        UserError: there is no such kind, or what the user says is missing or wrong.
    """
    if name not in KINDS:
        raise UserError(f'there is no robot "{name}"; there are {", ".join(KINDS)}')
    kind = _kind(name)
    if kind is None:
        raise UserError(f"there is no robot {name} here: {ABSENT}")
    return kind.robot(options or Options())


def open_faced(name: str, options: Options, face: Face) -> Robot:
    """The robot that a user means, with a face; it need not speak itself.

    Args:
        name: of the kind.
        options: what the user says about it.
        face: on which it speaks.

    Raises:
        UserError: there is no such kind, or what the user says is missing or wrong.
    """
    silent = open_robot(name, replace(options, skills=unspoken(options.skills)))
    return Faced(silent, face, options.skills)


def all_readiness(ros_python: Path = Options.ros_python) -> list[Readiness]:
    """Of each kind of robot, whether it can be used here, and if not, what is missing.

    Args:
        ros_python: the interpreter that the robot's ROS belongs to.
    """
    return [_readiness(name, ros_python) for name in KINDS]


def _readiness(name: str, ros_python: Path) -> Readiness:
    kind = _kind(name)
    if kind is None:
        return Readiness(name, works=False, missing=ABSENT)
    return cast("RosKind", kind).readiness(ros_python) if name in OF_A_PYTHON else kind.readiness()


def _kind(name: str) -> Kind | None:
    module = f"{__package__}.{KINDS[name]}"
    try:
        return cast("Kind", importlib.import_module(module))
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return None
