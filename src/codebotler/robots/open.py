"""From the name of a kind of robot to the robot."""

from __future__ import annotations

import importlib
from typing import Protocol, cast

from codebotler.badinput import BadInput
from codebotler.robots.base import Options, Readiness, Robot

KINDS = {
    "sim": "simulated",
    "pyrobosim": "pyrobosim",
    "ros1": "ros1",
    "rosbridge": "rosbridge",
    "ros2": "ros2",
}
"""Kinds of robots as a user names them, with the module of each."""

ABSENT = "it is not part of this version"


class Kind(Protocol):
    """A module about one kind of robot; importing it takes nothing heavy."""

    def readiness(self) -> Readiness:
        """Whether such robots can be used here; takes less than a second and changes nothing."""

    def robot(self, options: Options) -> Robot:
        """The robot that a user means, not yet connected.

        Raises:
            BadInput: what the user says of it is missing or wrong.
        """


def open_robot(name: str, options: Options | None = None) -> Robot:
    """The robot that a user means, not yet connected.

    Args:
        name: of the kind: sim, pyrobosim, ros1, rosbridge or ros2.
        options: what the user says about it.

    Raises:
        BadInput: there is no such kind, or what the user says is missing or wrong.
    """
    if name not in KINDS:
        raise BadInput(f'there is no robot "{name}"; there are {", ".join(KINDS)}')
    kind = _kind(name)
    if kind is None:
        raise BadInput(f"there is no robot {name} here: {ABSENT}")
    return kind.robot(options or Options())


def all_readiness() -> list[Readiness]:
    """Of each kind of robot, whether it can be used here, and if not, what is missing."""
    kinds = {name: _kind(name) for name in KINDS}
    return [
        kind.readiness() if kind else Readiness(name, works=False, missing=ABSENT)
        for name, kind in kinds.items()
    ]


def _kind(name: str) -> Kind | None:
    module = f"{__package__}.{KINDS[name]}"
    try:
        return cast("Kind", importlib.import_module(module))
    except ModuleNotFoundError as error:
        if error.name != module:
            raise
        return None
