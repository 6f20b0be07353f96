"""A robot behind a rosbridge: ROS over a websocket, with nothing of ROS on this machine."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

from codebotler.core.skills import SKILLS, SkillTable
from codebotler.robots.base import ROS_PYTHON, Options, Readiness
from codebotler.robots.ros import RosRobot, Waits

WORKER = Path(__file__).with_name("worker.py")
ADDRESS = "ws://localhost:9090"
NOTE = "robots of ROS 2 behind it were tested against a stand-in for the protocol only"


class Rosbridge(RosRobot):
    """A robot behind a rosbridge.

    Args:
        address: such as ws://robot:9090; empty for this machine.
        skills: the skills it may be asked to perform.
        speed: of its clock.
        waits: time limits.
    """

    def __init__(
        self,
        address: str = "",
        *,
        skills: SkillTable = SKILLS,
        speed: float | None = 1.0,
        waits: Waits | None = None,
    ) -> None:
        python, environment, where = Path(sys.executable), {"PYTHONSAFEPATH": "1"}, address or ADDRESS
        super().__init__(
            "rosbridge", where, WORKER, python, environment, skills=skills, speed=speed, waits=waits
        )


def readiness(_ros_python: Path = ROS_PYTHON) -> Readiness:
    """It needs nothing of ROS on this machine."""
    _check_websockets()
    return Readiness("rosbridge", works=True, note=f"at --address, {ADDRESS} by default; {NOTE}")


def robot(options: Options) -> Rosbridge:
    """The robot of these options."""
    _check_websockets()
    return Rosbridge(options.address, skills=options.skills, speed=options.speed)


def _check_websockets() -> None:
    """Raise here what would else break the worker, whose process imports it."""
    if find_spec("websockets") is None:
        raise ModuleNotFoundError("websockets is not installed", name="websockets")
