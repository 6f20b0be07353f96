"""What every robot offers: the `Robot` protocol, its errors and its options."""

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

Argument: TypeAlias = Scalar | tuple[Scalar, ...]
"""An argument of a skill: a text or another value, a list of these, or the options of a question."""

Result: TypeAlias = Scalar | list[str] | list[Scalar] | None
"""What a skill returns; for a question the text of the chosen option."""

ROS_PYTHON = Path("/usr/bin/python3")
"""The interpreter that a robot's ROS usually belongs to."""


@dataclass(frozen=True)
class Picture:
    """Something the robot saw.

    Args:
        data: a JPEG or PNG file, not yet validated.
    """

    data: bytes


Feedback: TypeAlias = Callable[[str | Picture], None]
"""Called from any thread with the progress of a skill, such as `at (3.1, 2.0)`, and with pictures."""


def no_feedback(_: str | Picture) -> None:
    """Ignore feedback."""


class Robot(Protocol):
    """Something that executes skills, one at a time, and can be stopped at any moment."""

    @property
    def name(self) -> str:
        """The kind of robot: simulated, pyrobosim, ros1, rosbridge or ros2."""

    @property
    def address(self) -> str:
        """What tells it from others of its kind, such as the URI of a ROS master; empty if only we use it.

        Different spellings of a network address are recognised.
        """

    @property
    def if_tool_dies(self) -> str:
        """What happens to a running skill when this process is killed, as a clause without a full stop."""

    @property
    def rooms_are_regexes(self) -> bool:
        """Whether the rooms that it lists are regexes, as world files write them, and not plain names."""

    @property
    def has_pose(self) -> bool:
        """Whether its feedback says where it is while it moves, as in `at (3.1, 2.0)`, in metres."""

    @property
    def skills(self) -> SkillTable:
        """The skills it may be asked to perform."""

    @property
    def missing(self) -> Mapping[str, str]:
        """Why it cannot perform some of its skills, by name, as far as that was known when it connected."""

    @property
    def clock(self) -> Clock:
        """The time by which a program sleeps."""

    def connect(self) -> None:
        """Make the robot ready and at rest, with its clock at 0; also after a `cancel`.

        Raises:
            NotReadyError: it cannot be used; nothing is left open then.
        """

    def perform(
        self, skill: str, arguments: Sequence[Argument], feedback: Feedback = no_feedback, /
    ) -> Result:
        """Execute a skill to its end; called from one thread at a time.

        Args:
            skill: its name in the table.
            arguments: in the order of its parameters.
            feedback: called with its progress.

        Raises:
            RobotError: (of `codebotler.simulator.robot`) the robot cannot do it; the program sees this.
            CancelledError: `cancel` was called before or meanwhile, or another client stopped the robot.
            RobotLostError: the robot is gone or no longer answers.
        """

    def cancel(self) -> None:
        """End the current skill, if any, and refuse all others until the next `connect`.

        Called from any thread. It returns as soon as the robot has been told; `perform` returns when the
        skill has ended. Without a connection it does nothing, and it raises nothing.
        """

    def disconnect(self) -> None:
        """End whatever goes on and release all resources; may be called again."""


class NotReadyError(Exception):
    """A robot cannot be used.

    Args:
        sentence: what is missing, and how to fix it.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


class RobotLostError(Exception):
    """A connected robot is gone or no longer answers.

    Args:
        sentence: how that was noticed.
    """

    def __init__(self, sentence: str) -> None:
        super().__init__(sentence)
        self.sentence = sentence


class CancelledError(Exception):
    """A skill was ended on demand."""


@dataclass(frozen=True)
class Readiness:
    """Whether robots of one kind can be used on this machine.

    Args:
        name: the kind as a user names it: sim, pyrobosim, ros1, rosbridge or ros2.
        works: whether they can, as far as can be seen without connecting.
        missing: what is missing, as a phrase; empty if it works.
        mend: the command that fixes it, if one does.
        note: what a user should know about it, such as how far it was tested.
    """

    name: str
    works: bool
    missing: str = ""
    mend: str = ""
    note: str = ""


@dataclass(frozen=True)
class Options:
    """A user's options for opening a robot; each kind uses those that concern it.

    Args:
        world: the world of a simulated robot.
        speed: seconds of the robot's clock per real second; None if waiting takes no real time.
        address: of the robot, such as the URI of a ROS master or rosbridge; empty for the default.
        ros_python: the interpreter that the robot's ROS belongs to.
        skills: the skills it may be asked to perform.
        connection: what a robot on ROS offers, where that is not an action for each skill.
    """

    world: World | None = None
    speed: float | None = 1.0
    address: str = ""
    ros_python: Path = ROS_PYTHON
    skills: SkillTable = SKILLS
    connection: Connection | None = None
