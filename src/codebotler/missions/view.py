"""A mission session at one moment, for the command line, the page and the API."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from codebotler.checking.problems import CheckResult
from codebotler.generation.no_program import ProgramlessReply
from codebotler.generation.partial_reply import PartialReply, split_partial
from codebotler.missions.log import State
from codebotler.missions.progress import Progress
from codebotler.prompts import clean_instruction
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.sampled_robot import RoomMap

UNREADABLE = frozenset({"SyntaxError", "IndentationError", "TabError"})
"""Problems with which a program never begins."""

CHECKING = "checking"  # what a session is busy with

Phase: TypeAlias = State | Literal["", "starting", "writing", "checking", "no-program"]


@dataclass(frozen=True)
class Order:
    """What a person asks for: an instruction and the model that writes the program, or a program.

    Raises:
        UserError: it says nothing.
    """

    instruction: str = ""
    model: str = ""  # its name; empty where none may be asked
    program: str = ""
    author: str = ""  # the model that wrote the program, if one did

    def __post_init__(self) -> None:
        if not self.has_program:
            clean_instruction(self.instruction)

    @property
    def has_program(self) -> bool:
        """Whether the program comes with the order, so that no model writes it."""
        return bool(self.program.strip())


@dataclass(frozen=True)
class SessionView:
    """A session at one moment, the same for all who observe it."""

    number: int = 0  # of the session, from 1; 0 before the first
    id: str = ""  # of the mission; empty until it exists
    state: State | None = None  # of the mission
    reason: str = ""  # why it came to that state
    line: int | None = None  # of the program, where it failed
    busy: str = ""  # what goes on before the robot moves, such as `checking`
    error: str = ""  # why it could not go on, in a sentence
    suggestions: tuple[str, ...] | None = None  # instructions that the model does know
    instruction: str = ""
    model: str = ""  # its name; empty where none may be asked
    program: str = ""
    reply: str = ""  # while a model writes, as much as has arrived
    programless: ProgramlessReply | None = None  # the model's last reply, if that holds no program
    author: str = ""  # the model that wrote it; empty if a person did
    is_written: bool = False  # whether a model is writing now
    check: CheckResult | None = None  # of this very program
    missing_skills: tuple[str, ...] = ()  # that the program calls and the robot lacks, in sentences
    unknown_rooms: tuple[str, ...] = ()  # that the program names and the robot does not know, in sentences
    room_map: RoomMap | None = None  # of the robot, as far as it says
    remarks: tuple[str, ...] = ()  # likely mistakes about the robot, in sentences
    rules: tuple[Rule, ...] = ()  # house rules
    disabled_rules: tuple[str, ...] = ()  # names of those that a person has switched off for this program
    progress: Progress = field(default_factory=Progress)
    is_over: bool = True

    @property
    def problems(self) -> tuple[str, ...]:
        """What speaks against running the program, in sentences."""
        found = () if self.check is None else self.check.problems
        return (*(problem.sentence for problem in found), *self.missing_skills)

    @property
    def rules_in_force(self) -> tuple[Rule, ...]:
        """The rules that count in this mission."""
        return tuple(rule for rule in self.rules if rule.name not in self.disabled_rules)

    @property
    def can_run(self) -> bool:
        """Whether the program, right or wrong, can run at all."""
        return self.check is None or not any(one.kind in UNREADABLE for one in self.check.problems)

    @property
    def arriving(self) -> PartialReply:
        """The reply that a model is writing, as much as has arrived."""
        return split_partial(self.reply)

    @property
    def digest(self) -> str:
        """Names this program and no other, for those who approve it."""
        return digest(self.program)

    @property
    def phase(self) -> Phase:
        """What goes on, or how it ended."""
        if self.is_over or self.is_running:
            return "" if self.state is None else self.state
        if self.is_written:
            return "writing"
        if self.busy == CHECKING:
            return "checking"
        if self.waits_for_program:
            return "no-program"
        return "starting" if self.busy or self.state is None else self.state

    @property
    def is_running(self) -> bool:
        """Whether the robot works, or ends what it did."""
        return self.state is not None and self.state.is_moving and not self.is_over

    @property
    def may_be_approved(self) -> bool:
        """Whether the program can be approved as it stands."""
        return self.state is State.CHECKED and not self.is_over and not self.busy

    @property
    def waits_for_program(self) -> bool:
        """Whether a person has to go on, since a model has replied without a program."""
        is_open = self.state is State.DRAFTING and not self.is_over and not self.busy
        return is_open and self.programless is not None

    @property
    def may_be_asked_again(self) -> bool:
        """Whether the model can write another program."""
        is_waiting = self.may_be_approved or self.waits_for_program
        return is_waiting and bool(self.instruction and self.model)

    @property
    def may_be_edited(self) -> bool:
        """Whether another program can replace this one."""
        if self.is_over or self.is_written:
            return self.is_over
        waits = self.state is None and bool(self.program)  # for the robot; nothing typed is lost
        return waits or (self.state is not None and self.state.is_open)


def digest(program: str) -> str:
    """A short name of a program, by its content."""
    return hashlib.sha256(program.encode(errors="surrogatepass")).hexdigest()[:16]
