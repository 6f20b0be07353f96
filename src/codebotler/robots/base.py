"""Define the `Robot` protocol, the errors that robots raise, and the options for opening them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.skills.values import Scalar
from codebotler.core.world import World
from codebotler.robots.clock import Clock

if TYPE_CHECKING:
    from codebotler.robots.ros.connections.connection import Connection

RobotArgument: TypeAlias = Scalar | tuple[Scalar, ...]
"""An argument of a skill: a single value, several values, or the options of a question."""

RobotResult: TypeAlias = Scalar | list[str] | list[Scalar] | None
"""The result of a skill: for a question, the text of the chosen option; None for a skill without a result."""

STOP_BY_HAND = "STOP THE ROBOT BY HAND"
ROS_PYTHON = Path("/usr/bin/python3")
"""The usual Python of a robot's ROS installation."""


@dataclass(frozen=True)
class CameraPicture:
    """A camera picture that the robot sent: `data` holds a JPEG or PNG file, not yet validated."""

    data: bytes  # the contents of a JPEG or PNG file, not yet validated


Feedback: TypeAlias = Callable[[str | CameraPicture], None]
"""A callback for progress reports such as `at (3.1, 2.0)` and for pictures. Any thread may call it."""


def ignore_feedback(_: str | CameraPicture) -> None:
    """Discard a progress report or a picture. This is the default callback of `Robot.perform`."""


class Robot(Protocol):
    """A robot that executes skills, one at a time, and can be stopped at any moment."""

    @property
    def name(self) -> str:
        """The kind of robot: simulated, pyrobosim, ros1, rosbridge, ros2, or the class in the user's file."""

    @property
    def address(self) -> str:
        """The robot's address, such as a ROS master URI, or "" if no other process can reach the robot."""

    @property
    def if_tool_dies(self) -> str:
        """The fate of the robot if this process is killed, such as `the robot ended as well`."""

    @property
    def rooms_are_regexes(self) -> bool:
        """Whether room names are regular expressions, as in world files, rather than plain names."""

    @property
    def has_pose(self) -> bool:
        """Whether the robot reports its position in metres while it moves, as in `at (3.1, 2.0)`."""

    @property
    def skills(self) -> SkillTable:
        """The skills that programs may call."""

    @property
    def missing(self) -> Mapping[str, str]:
        """Maps each unavailable skill to the reason. The mapping is complete once the robot is connected."""

    @property
    def clock(self) -> Clock:
        """The clock that times a program's sleeps."""

    def connect(self) -> None:
        """Make the robot ready, with its clock at 0. Call this first, and again after each `cancel`.

        Raise NotReadyError, and release all resources, if the robot cannot be used.
        """

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback, /
    ) -> RobotResult:
        """Perform a skill to its end, and return its result. Only one thread at a time may call this method.

        Args:
            skill: the name of the skill in the table.
            arguments: the skill's arguments, in the order of its parameters.
            feedback: a callback for progress reports and pictures.

        Raises:
            RobotError: the skill failed. Programs can catch this error.
            CancelledError: `cancel` was called, or another client stopped the robot.
            RobotLostError: the robot no longer responds.
        """

    def cancel(self) -> None:
        """Stop the current skill, if any, and refuse all others until the next `connect`.

        This method is thread-safe and never raises. It returns once the stop command has been sent. A running
        `perform` returns once its skill has ended.
        """

    def disconnect(self) -> None:
        """Stop the current skill and release all resources. Later calls of `disconnect` have no effect."""


class _SentenceError(Exception):
    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


class NotReadyError(_SentenceError):
    """Raised when a robot cannot be used. Its `sentence` says why, and how to fix the problem."""


class RobotLostError(_SentenceError):
    """Raised when a connected robot no longer responds. Its `sentence` says why."""


class AnswerError(_SentenceError):
    """Raised when a person's answer to the robot's question is too late or invalid."""


class CancelledError(Exception):
    """Raised by a skill that was cancelled because the robot was stopped."""


@dataclass(frozen=True)
class Readiness:
    """Whether a kind of robot, such as ros2, works on this machine and, if not, how to make it work."""

    name: str  # the kind: sim, pyrobosim, ros1, rosbridge or ros2
    works: bool  # whether all requirements are installed; the robot itself is not contacted
    missing: str = ""  # a clause that names the missing requirement; empty if there is none
    mend: str = ""  # a command that installs the missing requirement; empty if there is none
    note: str = ""  # further advice for the user, such as how to choose the address


@dataclass(frozen=True)
class Options:
    """Options for opening a robot, such as its world or address. Each kind of robot uses only some."""

    world: World | None = None  # the world of a simulated robot
    speed: float | None = 1.0  # clock seconds per real second; None to skip all waits
    address: str = ""  # the robot's address, such as a ROS master URI; empty for the default
    ros_python: Path = ROS_PYTHON  # the Python interpreter of the robot's ROS installation
    skills: SkillTable = SKILLS  # the skills that programs may call
    connection: Connection | None = None  # the ROS interface; None if each skill has its own action
