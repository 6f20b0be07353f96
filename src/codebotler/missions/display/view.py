"""A snapshot of a mission session, for the command line, the page and the API."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from codebotler.candidates.question import ClarifyingQuestion
from codebotler.checking.problems import CheckResult
from codebotler.core.errors import UserError
from codebotler.generation.no_program import ProgramlessReply
from codebotler.generation.partial_reply import PartialReply, split_partial
from codebotler.missions.display.progress import Progress
from codebotler.missions.mission import Driver
from codebotler.missions.storage.log import MissionState
from codebotler.missions.storage.past import MissionPast
from codebotler.prompts import clean_instruction
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.worlds.room_map import RoomMap

_SYNTAX_ERRORS = frozenset({"SyntaxError", "IndentationError", "TabError"})
"""The kinds of problems that prevent a program from starting."""

CHECKING = "checking"  # a value of `SessionView.busy`

UNCHECKED: dict[str, object] = {
    "check": None,
    "missing_skills": (),
    "unknown_rooms": (),
    "programless": None,
    "busy": CHECKING,
}
"""Values that reset the results of the check in a `SessionView`, for a program that is not checked yet."""

Phase: TypeAlias = MissionState | Literal["", "starting", "writing", "checking", "no-program", "question"]


@dataclass(frozen=True)
class MissionOrder:
    """A request for a mission: an instruction for a model, or a program.

    Raises UserError if both are empty, or if a person must first say whether `past`'s last step happened.
    """

    instruction: str = ""
    model: str = ""  # empty if no model may be asked
    program: str = ""
    author: str = ""  # the model or the agent that wrote the program, if any
    drive: Driver | None = None  # controls the robot in place of exactly this program
    contract: Contract | None = None  # what `drive` may do at most
    past: MissionPast | None = None  # of the mission whose rest is requested
    candidates: int = 1  # how many programs to get from the model
    asks: bool = True  # whether somebody can say which of several behaviours they mean

    def __post_init__(self) -> None:
        if self.past is not None and self.past.unsure is not None:
            raise UserError(f"{self.past.unsure_step_text}; a person must say whether this happened")
        if not self.has_program:
            clean_instruction(self.instruction)

    def first_view(self, number: int, rules: tuple[Rule, ...], within: Contract | None) -> SessionView:
        """Return the initial view of session `number`. If given, `within` limits what a program may do."""
        return SessionView(
            number,
            instruction=self.instruction,
            model=self.model,
            program=self.program,
            author=self.author,
            busy="waiting",
            rules=rules,
            within=within,
            past=self.past,
            progress=Progress() if self.past is None else self.past.progress,
            is_over=False,
        )

    @property
    def has_program(self) -> bool:
        """Whether the order contains the program, so that no model needs to write one."""
        return bool(self.program.strip())


@dataclass(frozen=True)
class SessionView:
    """An immutable snapshot of a mission session: its program, the result of the check, and its progress."""

    number: int = 0  # counts sessions from 1; 0 before the first
    id: str = ""  # the ID of the mission; empty until it exists
    state: MissionState | None = None  # the state of the mission
    reason: str = ""  # why the mission is in that state
    line: int | None = None  # the program's line at which the mission failed
    busy: str = ""  # the work before the robot moves, such as `checking`
    error: str = ""  # the last error, as a sentence
    suggestions: tuple[str, ...] | None = None  # similar instructions that a recorded model knows
    instruction: str = ""
    model: str = ""  # empty if no model may be asked
    program: str = ""
    reply: str = ""  # the part received so far, while a model is writing
    programless: ProgramlessReply | None = None  # the model's last reply, if it contains no program
    author: str = ""  # the model that wrote the program; empty for a person
    is_written: bool = False  # whether a model is writing now
    check: CheckResult | None = None  # the result for exactly this program
    missing_skills: tuple[str, ...] = ()  # sentences about skills that the robot lacks
    unknown_rooms: tuple[str, ...] = ()  # sentences about rooms that the robot does not know
    room_map: RoomMap | None = None  # the robot's rooms, if it lists them
    remarks: tuple[str, ...] = ()  # sentences about likely mistakes in the robot's setup
    rules: tuple[Rule, ...] = ()
    disabled_rules: tuple[str, ...] = ()  # the names of rules switched off for this program
    within: Contract | None = None  # what every program of the session may do
    past: MissionPast | None = None  # of the mission whose rest the session does
    question: ClarifyingQuestion | None = None  # which of several behaviours a person means
    earlier: Contract | None = None  # the contract of the session's last checked program but this one
    progress: Progress = field(default_factory=Progress)
    is_over: bool = True

    @property
    def problems(self) -> tuple[str, ...]:
        """Sentences about problems that the check found, and about skills that the robot lacks."""
        found = () if self.check is None else self.check.problems
        return (*(problem.sentence for problem in found), *self.missing_skills)

    @property
    def contract(self) -> Contract | None:
        """The upper bound on what the program may do, as derived by the check, or None if there is none."""
        return None if self.check is None else self.check.contract

    @property
    def rules_in_force(self) -> tuple[Rule, ...]:
        """The house rules, except those that a person has switched off for this program."""
        return tuple(rule for rule in self.rules if rule.name not in self.disabled_rules)

    @property
    def can_run(self) -> bool:
        """Whether the program can start, that is, has no syntax error. People can accept other problems."""
        return self.check is None or not any(one.kind in _SYNTAX_ERRORS for one in self.check.problems)

    @property
    def arriving(self) -> PartialReply:
        """The part of a model's reply that has arrived, split into text and code."""
        return split_partial(self.reply)

    @property
    def digest(self) -> str:
        """The hash that identifies exactly this program in an approval."""
        return program_digest(self.program)

    @property
    def phase(self) -> Phase:
        """The work of the session, such as `writing`, or else the mission's state; "" if there is neither."""
        if self.is_over or self.is_running:
            return "" if self.state is None else self.state
        if self.is_written:
            return "writing"
        if self.busy == CHECKING:
            return "checking"
        if self.waits_for_program:
            return "no-program"
        if self.waits_for_answer:
            return "question"
        return "starting" if self.busy or self.state is None else self.state

    @property
    def is_running(self) -> bool:
        """Whether the robot is working or stopping."""
        return self.state is not None and self.state.is_moving and not self.is_over

    @property
    def is_approved(self) -> bool:
        """Whether the program is approved and has not ended: the robot works or will soon begin."""
        return self.is_running or (self.state is MissionState.APPROVED and not self.is_over)

    @property
    def may_be_approved(self) -> bool:
        """Whether the program is checked and can be approved now."""
        return self.state is MissionState.CHECKED and not (self.is_over or self.busy or self.question)

    @property
    def waits_for_program(self) -> bool:
        """Whether a model replied without a program, so that a person must ask again, write one, or stop."""
        is_open = self.state is MissionState.DRAFTING and not self.is_over and not self.busy
        return is_open and self.programless is not None and self.question is None

    @property
    def waits_for_answer(self) -> bool:
        """Whether a person must answer `question`, by saying which of several behaviours they mean."""
        return self.question is not None and not self.is_over and not self.busy

    @property
    def may_be_asked_again(self) -> bool:
        """Whether a person can ask the model for another program now."""
        is_waiting = self.may_be_approved or self.waits_for_program
        return is_waiting and bool(self.instruction and self.model)

    @property
    def may_be_edited(self) -> bool:
        """Whether a person can edit the program now. After the session, an edit begins a new mission."""
        if self.is_over or self.is_written:
            return self.is_over
        waits = self.state is None and bool(self.program)  # for the robot; edits are kept until then
        return waits or (self.state is not None and self.state.is_open)


def program_digest(program: str) -> str:
    """Return the SHA-256 hash of a program, in hexadecimal. Approvals name a program by this hash."""
    return hashlib.sha256(program.encode(errors="surrogatepass")).hexdigest()
