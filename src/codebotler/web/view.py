"""What is asked for at the robot, and a mission's turn as all viewers see it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field

from codebotler.checking.problems import Check
from codebotler.missions.mission import State
from codebotler.simulator.sampled_robot import RoomMap
from codebotler.web.progress import Progress


@dataclass(frozen=True)
class Order:
    """What somebody asks for.

    Args:
        instruction: in plain words; may be empty if there is a program.
        model: the name of who is to write the program; empty if nobody is to.
        program: which is there already.
    """

    instruction: str = ""
    model: str = ""
    program: str = ""


@dataclass(frozen=True)
class View:
    """A turn as all viewers see it; it never changes.

    Args:
        number: of the turn, from 1; 0 where there was none yet.
        id: of the mission; empty until there is one.
        state: of the mission; None until there is one.
        busy: what goes on before the robot moves, such as `checking`; empty if nothing does.
        trouble: why it could not go on, in a sentence.
        order: what was asked for.
        program: as it stands; a reply as far as it has come, while a model writes.
        author: the model that wrote the program as it stands; empty if a person did.
        is_written: whether a model is writing just now.
        found: by the check of this very program; None until it is there.
        problems: of the check and of the robot's skills, each in a sentence.
        unknown: rooms that the program names and the robot does not know, each in a sentence.
        plan: the robot's rooms, as far as it tells.
        reason: why the mission came to its state.
        progress: of the robot.
        is_over: whether nothing can happen any more.
    """

    number: int = 0
    id: str = ""
    state: State | None = None
    busy: str = ""
    trouble: str = ""
    order: Order = field(default_factory=Order)
    program: str = ""
    author: str = ""
    is_written: bool = False
    found: Check | None = None
    problems: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    plan: RoomMap | None = None
    reason: str = ""
    progress: Progress = field(default_factory=Progress)
    is_over: bool = True

    @property
    def digest(self) -> str:
        """What tells this program from others; who approves one names it by this."""
        return digest(self.program)

    @property
    def is_running(self) -> bool:
        """Whether the robot works, or is ending what it did."""
        return self.state in {State.RUNNING, State.STOPPING} and not self.is_over

    @property
    def may_be_approved(self) -> bool:
        """Whether the program can be approved as it stands."""
        return self.state is State.CHECKED and not self.is_over and not self.busy

    @property
    def may_be_edited(self) -> bool:
        """Whether another program can take the place of this one."""
        if self.is_over or self.is_written:
            return self.is_over
        waits = self.state is None and bool(self.order.program)  # for the robot; who types on loses nothing
        return waits or self.state in {State.DRAFTING, State.CHECKED}


def digest(program: str) -> str:
    """What tells a program from others."""
    return hashlib.sha256(program.encode(errors="surrogatepass")).hexdigest()[:16]
