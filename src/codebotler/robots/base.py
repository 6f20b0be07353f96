"""What all robots have in common; whatever stands above them knows only this."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeAlias

from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.world import World
from codebotler.robots.clock import Clock

Argument: TypeAlias = str | tuple[str, ...]
"""What a skill is given: a text, or the options of a question."""

Result: TypeAlias = str | list[str] | bool | None
"""What a skill gives back; for a question the text of the chosen option."""


@dataclass(frozen=True)
class Picture:
    """What a robot saw.

    Args:
        data: a JPEG or PNG file, if the robot keeps to that; nobody has looked into it.
    """

    data: bytes


Feedback: TypeAlias = Callable[[str | Picture], None]
"""Told how a skill goes on, in a short phrase such as `at (3.1, 2.0)`, and what is seen; from any thread."""


def untold(_what: str | Picture) -> None:
    """Tell nobody."""


class Robot(Protocol):
    """Something that executes skills, one at a time, and can be stopped at any moment."""

    @property
    def name(self) -> str:
        """What kind of robot it is: simulated, pyrobosim, ros1, rosbridge or ros2."""

    @property
    def address(self) -> str:
        """What tells it from others of its kind, such as the URI of a ROS master; empty if it is ours alone.

        Two that lead to the same robot are equal, see `codebotler.robots.address`.
        """

    @property
    def if_tool_dies(self) -> str:
        """What becomes of a skill that goes on when this process is killed, without a full stop."""

    @property
    def skills(self) -> SkillTable:
        """What it can be asked to do."""

    @property
    def missing(self) -> Mapping[str, str]:
        """Why it cannot perform some skills, by name, as far as it could tell when it was connected."""

    @property
    def clock(self) -> Clock:
        """Its time, by which a program sleeps."""

    def connect(self) -> None:
        """Make it ready for `perform`, at rest, with its clock at 0; also after a `cancel`.

        Raises:
            NotReadyError: it cannot be used; nothing is held then.
        """

    def perform(self, skill: str, arguments: Sequence[Argument], told: Feedback = untold) -> Result:
        """Execute a skill to its end; called from one thread at a time.

        Args:
            skill: its name in the table.
            arguments: in the order of its parameters.
            told: how it goes on, and what is seen.

        Raises:
            RobotError: (of `codebotler.simulator.robot`) the robot cannot do it; the program sees this.
            CancelledError: `cancel` was called, before or meanwhile, or somebody else stopped the robot.
            RobotLostError: the robot is gone, or does not answer any more.
        """

    def cancel(self) -> None:
        """End what goes on, if anything does, and all that is asked for before the next `connect`.

        Called from any thread. Back as soon as the robot was told so; what goes on then comes to its end in
        `perform`. Does nothing where nothing is connected, and raises nothing.
        """

    def disconnect(self) -> None:
        """Give back all that it holds; what still goes on is ended. Again does nothing."""


class NotReadyError(Exception):
    """A robot cannot be used.

    Args:
        sentence: what is missing, and the mend.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


class RobotLostError(Exception):
    """A robot that was connected is gone, or does not answer any more.

    Args:
        sentence: how that was noticed.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


class CancelledError(Exception):
    """What the robot was doing was ended on demand."""


@dataclass(frozen=True)
class Readiness:
    """Whether robots of a kind can be used here.

    Args:
        name: of the kind, as a user names it: sim, pyrobosim, ros1, rosbridge or ros2.
        works: whether they can, as far as can be seen without connecting.
        missing: what is missing, in a phrase; empty if it works.
        mend: the command that mends it, if one does.
        note: what a user should know of it, such as how far it was tested.
    """

    name: str
    works: bool
    missing: str = ""
    mend: str = ""
    note: str = ""


@dataclass(frozen=True)
class Options:
    """What a user says about the robot that is to be opened; each kind takes what concerns it.

    Args:
        world: where a simulated robot is, and what people answer; None where nobody named one.
        speed: how many seconds of the robot's clock pass in a real one; None if waiting takes no time.
        address: of the robot, such as the URI of a ROS master or of a rosbridge; empty for the usual one.
        ros_python: the interpreter that the robot's ROS belongs to.
        skills: what the robot can be asked to do.
    """

    world: World | None = None
    speed: float | None = 1.0
    address: str = ""
    ros_python: Path = Path("/usr/bin/python3")
    skills: SkillTable = SKILLS
