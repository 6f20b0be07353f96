"""The `Robot` protocol, its errors and its options."""

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
    from codebotler.robots.ros.connection import Connection

RobotArgument: TypeAlias = Scalar | tuple[Scalar, ...]
"""An argument of a skill: a single value, a list of values, or the options of a question."""

RobotResult: TypeAlias = Scalar | list[str] | list[Scalar] | None
"""The result of a skill; for a question, the text of the chosen option."""

STOP_BY_HAND = "STOP THE ROBOT BY HAND"
ROS_PYTHON = Path("/usr/bin/python3")
"""The usual Python of a robot's ROS installation."""


@dataclass(frozen=True)
class CameraPicture:
    """A picture from the robot."""

    data: bytes  # a JPEG or PNG file, not yet validated


Feedback: TypeAlias = Callable[[str | CameraPicture], None]
"""Called from any thread with the progress of a skill, such as `at (3.1, 2.0)`, and with pictures."""


def ignore_feedback(_: str | CameraPicture) -> None:
    """Ignore the feedback."""


class Robot(Protocol):
    """Executes skills, one at a time, and can be stopped at any moment."""

    @property
    def name(self) -> str:
        """The kind of robot: simulated, pyrobosim, ros1, rosbridge or ros2."""

    @property
    def address(self) -> str:
        """The address, such as the URI of a ROS master; empty if no other tool can reach the robot."""

    @property
    def if_tool_dies(self) -> str:
        """The effect of killing this process on a running skill, as a clause without a full stop."""

    @property
    def rooms_are_regexes(self) -> bool:
        """Whether its room names are regexes, as in world files, rather than plain names."""

    @property
    def has_pose(self) -> bool:
        """Whether its feedback reports its position in metres while it moves, as in `at (3.1, 2.0)`."""

    @property
    def skills(self) -> SkillTable:
        """The skills that it may be asked to perform."""

    @property
    def missing(self) -> Mapping[str, str]:
        """The reasons why it cannot perform some skills, by name, as known after connecting."""

    @property
    def clock(self) -> Clock:
        """The clock for a program's sleeps."""

    def connect(self) -> None:
        """Make the robot ready and at rest, with its clock at 0; also after a `cancel`.

        Raises:
            NotReadyError: the robot cannot be used; nothing stays open.
        """

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback, /
    ) -> RobotResult:
        """Execute a skill to its end; call it from one thread at a time.

        Args:
            skill: its name in the table.
            arguments: in the order of its parameters.
            feedback: called with the progress.

        Raises:
            RobotError: the robot cannot do it; programs can catch this.
            CancelledError: `cancel` was called, or another client stopped the robot.
            RobotLostError: the robot does not answer any more.
        """

    def cancel(self) -> None:
        """End the current skill, if any, and refuse all others until the next `connect`.

        Any thread may call it. It returns when the command is sent, and `perform` returns when the skill has
        ended. It never raises.
        """

    def disconnect(self) -> None:
        """End the current skill and release all resources; may be called repeatedly."""


class _SentenceError(Exception):
    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


class NotReadyError(_SentenceError):
    """A robot cannot be used; the sentence says why, and how to fix it."""


class RobotLostError(_SentenceError):
    """A connected robot does not answer any more; the sentence says why."""


class AnswerError(_SentenceError):
    """An answer to a robot's question is too late or invalid."""


class CancelledError(Exception):
    """A skill was cancelled."""


@dataclass(frozen=True)
class Readiness:
    """Whether robots of one kind can be used on this machine."""

    name: str  # the kind: sim, pyrobosim, ros1, rosbridge or ros2
    works: bool  # whether they can be used, as far as is known without connecting
    missing: str = ""  # the missing part, as a phrase; empty if nothing is missing
    mend: str = ""  # the command that installs the missing part, if there is one
    note: str = ""  # a remark for users, such as how to choose the address


@dataclass(frozen=True)
class Options:
    """Options for opening a robot; each kind uses some of them."""

    world: World | None = None  # the world of a simulated robot
    speed: float | None = 1.0  # clock seconds per real second; None if waiting takes no real time
    address: str = ""  # the address, such as the URI of a ROS master or rosbridge; empty for the default
    ros_python: Path = ROS_PYTHON  # the Python of the robot's ROS installation
    skills: SkillTable = SKILLS  # the skills that the robot may be asked to perform
    connection: Connection | None = None  # the calls of a robot on ROS; None for an action per skill
