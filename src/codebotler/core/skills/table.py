"""Skills as data for prompts, messages, checks and robots."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn, SupportsIndex

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import UserError
from codebotler.core.skills.own_modules import find_object, location_of
from codebotler.core.skills.values import TEXT_TYPE, ValueType, sample_values, written_call
from codebotler.core.skills.verbs import Verb


@dataclass(frozen=True)
class Parameter:
    """A parameter of a skill, with its name and the type of its values."""

    name: str
    type: ValueType = TEXT_TYPE
    is_options: bool = False  # whether it lists the options of a question, which may have any type

    @property
    def kind(self) -> str:
        """The name of the type in the sandbox, such as `str` or `list[int]`."""
        return "list" if self.is_options else self.type.kind

    @property
    def in_words(self) -> str:
        """The expected values in words, such as `a whole number`."""
        return "a list" if self.is_options else self.type.in_words


@dataclass(frozen=True)
class Recording:
    """How a call of a skill becomes an event in the trace."""

    kind: str  # the kind of event and its name in RTL, such as `goto`
    text: str  # the parameter that becomes the event's text; empty for no text
    options: str | None = None  # the parameter with the options of a question
    to: str | None = None  # the parameter that names the addressee
    names: str = ""  # the sort of thing that the text names, such as `room`; empty if the text is spoken
    when_tried: bool = False  # whether failed attempts are recorded, too
    judged_when_tried: bool = False  # whether failed attempts count for house rules
    more: tuple[str, ...] = ()  # further parameters whose values the event contains
    sets: str = ""  # the state into which it brings the thing that the text names
    clears: str = ""  # the state that it ends

    @property
    def is_spoken(self) -> bool:
        """Whether the robot speaks the text."""
        return not self.names

    @property
    def is_drive(self) -> bool:
        """Whether the text names a room that the robot drives to."""
        return self.names == "room"


ROS_PACKAGE = "robot_actions_pkg"
"""The ROS package with the actions of the paper's skills."""


@dataclass(frozen=True)
class RosAction:
    """The ROS action that executes a skill, with its topic and its fields (paper, section III.C)."""

    type: str
    server: str  # the topic under which the robot offers it
    goal: tuple[str, ...] = ()  # the fields, in the order of the parameters
    result: str | None = None  # the type of the only field of the result; None for no field
    failure: str = ""  # the kind of its only error; if empty, the robot reports the kind
    package: str = ROS_PACKAGE

    @property
    def definition(self) -> str:
        """The text of its .action file, whose field names and order must match the robot's."""
        result = "" if self.result is None else f"{self.result} result\n"
        return "".join(f"{line}\n" for line in self.goal) + f"---\n{result}---\n"


@dataclass(frozen=True)
class Skill:
    """A skill of the robot, from the paper (figure 2a) or custom.

    Args:
        name: the function that programs call.
        parameters: its parameters, in order.
        returns: the type of its result.
        doc: a sentence that explains it to authors of programs.
        recording: its event in the trace, if any.
        ros: the ROS action that executes it.
        verb: its English verb; None to show its name and arguments instead.
        seconds: its duration on the simulated clock in seconds, without driving.
        is_idle: whether it changes neither the robot nor its world.
        does: the function that acts on a simulated robot, its first argument.
        adds_event: whether the simulation records the event; False if `does` records it.
        fails: the kinds of its errors, and when each occurs.
        example: an example call for prompts.
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
        """Pickle the skill by reference if its module binds its name to it."""
        name = getattr(self.does, "__module__", "")
        module = sys.modules.get(name)
        if module is not None and getattr(module, self.name, None) is self:
            return find_object, (location_of(name), self.name)
        return super().__reduce_ex__(protocol)

    @property
    def is_drive(self) -> bool:
        """Whether its event names a room that the robot drives to."""
        return self.recording is not None and self.recording.is_drive

    @property
    def is_random(self) -> bool:
        """Whether its results are random because its function has an empty body."""
        return hasattr(self.does, "__wrapped__")

    @property
    def call(self) -> str:
        """An example call for prompts, such as `go_to("location")`."""
        return self.example or written_call(self.name, [_sample(each) for each in self.parameters])

    def wrong(self, sentence: str) -> NoReturn:
        """Raise a UserError with this sentence, and with the file and the line of the skill's function."""
        refuse(self.does, sentence)

    @property
    def signature(self) -> str:
        """The skill as a Python signature, such as `go_to(location: str) -> None`."""
        arguments = ", ".join(f"{p.name}: {p.type.annotation}" for p in self.parameters)
        return f"{self.name}({arguments}) -> {self.returns.annotation}"


def refuse(does: Callable[..., Any] | None, sentence: str) -> NoReturn:
    """Raise a UserError with a sentence and, if they are known, the file and the line of a function."""
    code = getattr(getattr(does, "__wrapped__", does), "__code__", None)
    if code is None:
        raise UserError(sentence)
    raise UserError(sentence, file=code.co_filename, line=code.co_firstlineno)


def _sample(parameter: Parameter) -> object:
    """Return an example argument, which for a string is the parameter's name."""
    names = [parameter.name] if parameter.type.base == "str" else []
    return sample_values(parameter.type, names)[0]


@dataclass(frozen=True)
class SkillTable(Mapping[str, Skill]):
    """Skills by name, in display order.

    Args:
        rows: the skills; names and recorded kinds are unique.

    Raises:
        ValueError: two rows share a name or a recorded kind.
    """

    rows: tuple[Skill, ...]

    def __post_init__(self) -> None:
        kinds = [skill.recording.kind for skill in self.rows if skill.recording]
        if len(self._by_name) != len(self.rows) or len(self.recordings) != len(kinds):
            raise ValueError("two skills share a name or a kind of event")

    @cached_property
    def _by_name(self) -> Mapping[str, Skill]:
        return {skill.name: skill for skill in self.rows}

    @cached_property
    def recordings(self) -> Mapping[str, Recording]:
        """For each kind of event that the skills add to a trace, such as `goto`, how it is recorded."""
        return {skill.recording.kind: skill.recording for skill in self.rows if skill.recording}

    @cached_property
    def idle(self) -> frozenset[str]:
        """The names of skills that change neither the robot nor its world, such as `say`."""
        return frozenset(skill.name for skill in self.rows if skill.is_idle)

    @cached_property
    def _hash(self) -> int:  # computed once, since tables are keys of caches
        return hash(self.rows)

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
        """Return a copy of this table with one more skill."""
        return SkillTable((*self.rows, skill))

    def without(self, names: Iterable[str]) -> SkillTable:
        """Return a copy of this table without the skills that have these names."""
        omitted = {*names}
        return SkillTable(tuple(row for row in self.rows if row.name not in omitted))
