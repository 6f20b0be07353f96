"""Skills as data, for prompts, messages, checks and robots."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn, SupportsIndex

from codebotler.core.errors import UserError
from codebotler.core.skills.own_modules import find_object, location_of
from codebotler.core.skills.values import TEXT_TYPE, ValueType, sample_values, written_call
from codebotler.core.skills.verbs import Verb


@dataclass(frozen=True)
class Parameter:
    """One argument of a skill."""

    name: str  # by which a program may pass it
    type: ValueType = TEXT_TYPE
    is_options: bool = False  # whether it lists the options of a question, which may be of any type

    @property
    def kind(self) -> str:
        """The type as the sandbox knows it."""
        return "list" if self.is_options else self.type.kind

    @property
    def words(self) -> str:
        """What programs must pass, in words."""
        return "a list" if self.is_options else self.type.words


@dataclass(frozen=True)
class Recording:
    """The event that a skill leaves in the trace."""

    kind: str  # of the event, and its name in RTL, such as `goto`
    text: str  # the parameter whose value is the event's text; empty if it has none
    options: str | None = None  # the parameter whose value is the event's list of options
    to: str | None = None  # the parameter that says whom it is for
    names: str = ""  # the sort of thing that the text names, such as `room`; empty for what is spoken
    when_tried: bool = False  # whether an attempt that fails is an event, too
    more: tuple[str, ...] = ()  # the parameters whose values follow the text

    @property
    def is_spoken(self) -> bool:
        """Whether the text is said aloud."""
        return not self.names

    @property
    def is_drive(self) -> bool:
        """Whether the robot goes to the place that the text names."""
        return self.names == "room"


ROS_PACKAGE = "robot_actions_pkg"
"""Of the actions of the paper's skills."""


@dataclass(frozen=True)
class RosAction:
    """The ROS action that carries a skill to a robot (paper, section III.C)."""

    type: str
    server: str  # the topic under which the robot offers it
    goal: tuple[str, ...] = ()  # its fields, in the order of the skill's parameters
    result: str | None = None  # the type of its only field, if it has one
    failure: str = ""  # the kind of its only error; if it is empty, the robot names the kind
    package: str = ROS_PACKAGE

    @property
    def definition(self) -> str:
        """The text of its .action file; names and order decide whether robots understand it."""
        result = "" if self.result is None else f"{self.result} result\n"
        return "".join(f"{line}\n" for line in self.goal) + f"---\n{result}---\n"


@dataclass(frozen=True)
class Skill:
    """One robot primitive of the paper's figure 2a, or one of a user's own.

    Args:
        name: the function a program calls.
        parameters: its arguments, in order.
        returns: the type of what comes back.
        doc: what it does, in a sentence for the person or model that writes programs.
        recording: its event in the trace; None for skills without one.
        ros: the action on a robot.
        verb: for people; without one, they read the skill's name and its arguments.
        seconds: how long the simulated robot takes by its clock, without driving.
        is_idle: whether it leaves the robot and its world as they are, however often it is executed.
        does: what it does to a simulated robot, its first argument.
        adds_event: whether the robot adds its event; otherwise, what it does adds that by itself.
        fails: the kinds of errors that it may end with, and when each occurs.
        example: a call of it that models are shown.
    """

    name: str
    parameters: tuple[Parameter, ...]
    returns: ValueType
    doc: str
    recording: Recording | None = None
    ros: RosAction | None = None
    verb: Verb | None = None
    seconds: float = 0.0
    is_idle: bool = False
    does: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    adds_event: bool = False
    fails: tuple[tuple[str, str], ...] = ()
    example: str = ""

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[Any, ...]:
        """By its name where that is in its module: there, the name of the function is that of the skill."""
        name = getattr(self.does, "__module__", "")
        module = sys.modules.get(name)
        if module is not None and getattr(module, self.name, None) is self:
            return find_object, (location_of(name), self.name)
        return super().__reduce_ex__(protocol)

    def with_function(self, does: Callable[..., Any]) -> Skill:
        """Return this skill with another function."""
        return replace(self, does=does, is_idle=False)

    @property
    def is_drive(self) -> bool:
        """Whether the robot goes to a place that its event names."""
        return self.recording is not None and self.recording.is_drive

    @property
    def is_random(self) -> bool:
        """Whether its function has no code, so that its results are random."""
        return hasattr(self.does, "__wrapped__")

    @property
    def call(self) -> str:
        """A call of it that models are shown."""
        return self.example or written_call(self.name, [_sample(each) for each in self.parameters])

    def wrong(self, sentence: str) -> NoReturn:
        """Raise a UserError that names the file and the line of its function."""
        refuse(self.does, sentence)

    @property
    def signature(self) -> str:
        """The skill as a Python signature, such as `go_to(location: str) -> None`."""
        arguments = ", ".join(f"{p.name}: {p.type.annotation}" for p in self.parameters)
        return f"{self.name}({arguments}) -> {self.returns.annotation}"


def refuse(does: Callable[..., Any] | None, sentence: str) -> NoReturn:
    """Raise a UserError that names the file and the line of a function, if it has any."""
    code = getattr(getattr(does, "__wrapped__", does), "__code__", None)
    if code is None:
        raise UserError(sentence)
    raise UserError(sentence, file=code.co_filename, line=code.co_firstlineno)


def _sample(parameter: Parameter) -> object:
    """A value that a parameter takes: its name, where it is a text."""
    value = parameter.type
    if value.choices:
        one: object = value.choices[0]
    else:
        one = parameter.name if value.base == "str" else sample_values(replace(value, is_list=False))[0]
    return [one] if value.is_list else one


@dataclass(frozen=True)
class SkillTable(Mapping[str, Skill]):
    """Skills by name, in the order in which they are shown.

    Args:
        rows: the skills; names and recorded kinds are unique.
        recordings: the events that a trace can have, by kind; follows from the rows.

    Raises:
        ValueError: two rows share a name or a recorded kind.
    """

    rows: tuple[Skill, ...]
    _by_name: Mapping[str, Skill] = field(init=False, repr=False, compare=False)
    recordings: Mapping[str, Recording] = field(init=False, repr=False, compare=False)
    _hash: int = field(init=False, repr=False, compare=False)
    _idle: frozenset[str] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        by_name = {skill.name: skill for skill in self.rows}
        kinds = [skill.recording.kind for skill in self.rows if skill.recording]
        if len(by_name) != len(self.rows) or len(set(kinds)) != len(kinds):
            raise ValueError("two skills share a name or a kind of event")
        object.__setattr__(self, "_by_name", by_name)
        recordings = {skill.recording.kind: skill.recording for skill in self.rows if skill.recording}
        object.__setattr__(self, "recordings", recordings)
        object.__setattr__(self, "_idle", frozenset(s.name for s in self.rows if s.is_idle))
        object.__setattr__(self, "_hash", hash(self.rows))  # once, since tables are keys of caches

    def __getitem__(self, name: str) -> Skill:
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self.rows)

    def __hash__(self) -> int:
        return self._hash

    def __repr__(self) -> str:
        return f"SkillTable({', '.join(self)})"

    def with_skill(self, skill: Skill) -> SkillTable:
        """Return this table with one more row."""
        return SkillTable((*self.rows, skill))

    def with_skills(self, others: Mapping[str, Skill]) -> SkillTable:
        """Return this table with the rows of another one that it lacks."""
        return SkillTable((*self.rows, *(row for name, row in others.items() if name not in self)))

    def without(self, names: Iterable[str]) -> SkillTable:
        """Return this table without the rows that have these names."""
        left_out = {*names}
        return SkillTable(tuple(row for row in self.rows if row.name not in left_out))

    def with_functions(self, **does: Callable[..., Any]) -> SkillTable:
        """Return these skills, some with another function."""
        return SkillTable(tuple(s.with_function(does[s.name]) if s.name in does else s for s in self.rows))

    @property
    def idle(self) -> frozenset[str]:
        """The skills that leave a robot and its world as they are."""
        return self._idle

    @property
    def verbs(self) -> Mapping[str, Verb]:
        """The verbs of events, by kind; kinds without a verb are absent."""
        return {s.recording.kind: s.verb for s in self.rows if s.recording and s.verb}
