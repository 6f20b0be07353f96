"""The skills: what a robot can do, each declared by one function.

Prompts, messages, checks and robots read the declarations; the body of a function does the skill to a
simulation.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import Any, Protocol, SupportsIndex


@dataclass(frozen=True)
class Parameter:
    """One argument of a skill."""

    name: str  # by which a program may pass it
    type: type[str] | type[list[object]] = str  # an argument must have exactly this type
    annotation: str = "str"  # the type as a reader sees it, such as `list[str]`


@dataclass(frozen=True)
class Recording:
    """What a skill leaves in the trace."""

    kind: str  # of the event, and its name in RTL, such as `goto`
    text: str  # the parameter whose value is the event's text
    options: str | None = None  # the parameter whose value is the event's list of options
    to: str | None = None  # the parameter that says whom it is for
    names: str = ""  # the sort of thing that the text names, such as `room`; empty for what is spoken
    when_tried: bool = False  # whether an attempt that fails is an event, too

    @property
    def is_spoken(self) -> bool:
        """Whether the text is said aloud."""
        return not self.names

    @property
    def is_drive(self) -> bool:
        """Whether the robot goes to the place that the text names."""
        return self.names == "room"


@dataclass(frozen=True)
class Verb:
    """A skill in English; the event's text follows it."""

    base: str  # `pick up`
    third: str  # `picks up`
    past: str  # `picked up`
    ing: str  # `picking up`
    alone: str = ""  # `picked something up`, where no object follows
    results: tuple[str, str] = ("no", "yes")  # what False and True mean


@dataclass(frozen=True)
class RosAction:
    """The ROS action that carries a skill to a robot (paper, section III.C)."""

    type: str  # in the package `robot_actions_pkg`
    server: str  # the topic under which the robot offers it
    goal: tuple[str, ...] = ()  # its fields, in the order of the skill's parameters
    result: str | None = None  # the type of its only field, if it has one
    failure: str = ""  # the kind of its only error; if it is empty, the robot names the kind

    @property
    def definition(self) -> str:
        """The text of its .action file; names and order decide whether robots understand it."""
        result = "" if self.result is None else f"{self.result} result\n"
        return "".join(f"{line}\n" for line in self.goal) + f"---\n{result}---\n"


@dataclass(frozen=True)
class Skill:
    """One robot primitive of the paper's figure 2a.

    Args:
        name: the function a program calls.
        parameters: its arguments, in order.
        returns: the annotation of what comes back.
        doc: what it does, in a sentence for the person or model that writes programs.
        recording: its event in the trace; None for skills without one.
        ros: the action on a robot.
        verb: for people; without one, they read the skill's name and its arguments.
        seconds: how long the simulated robot takes by its clock, besides driving.
        is_idle: whether it leaves the robot and its world as they are, however often it is executed.
        does: what it does to a simulated robot, its first argument.
    """

    name: str
    parameters: tuple[Parameter, ...]
    returns: str
    doc: str
    recording: Recording | None = None
    ros: RosAction | None = None
    verb: Verb | None = None
    seconds: float = 0.0
    is_idle: bool = False
    does: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[Any, ...]:
        """By its name where that is in its module: there, the name of the function is that of the skill."""
        module = getattr(self.does, "__module__", "")
        if getattr(sys.modules.get(module), self.name, None) is self:
            return _declared_in, (module, self.name)
        return super().__reduce_ex__(protocol)

    def doing(self, does: Callable[..., Any]) -> Skill:
        """The same skill, which does something else."""
        return replace(self, does=does, is_idle=False)

    @property
    def signature(self) -> str:
        """The skill as a Python signature, such as `go_to(location: str) -> None`."""
        arguments = ", ".join(f"{p.name}: {p.annotation}" for p in self.parameters)
        return f"{self.name}({arguments}) -> {self.returns}"


def _declared_in(module: str, name: str) -> Skill:
    found: Skill = getattr(import_module(module), name)
    return found


class Simulation(Protocol):
    """What a skill can do to a robot in a simulated world; whatever fails is a RobotError."""

    @property
    def room(self) -> str:
        """The room that the robot is in."""

    @property
    def rooms(self) -> Sequence[str]:
        """All rooms."""

    def drive(self, location: str) -> None:
        """Go to the room that a request means."""

    def look(self, entity: str) -> bool:
        """Whether an object or a person is here."""

    def ask(self, person: str, question: str, options: Sequence[Any]) -> Any:  # noqa: ANN401 - an option, or its number
        """Ask somebody here, who chooses one of the options."""

    def take(self, obj: str) -> None:
        """Pick up an object that is here."""

    def put(self, obj: str) -> None:
        """Put down what the robot holds."""

    def record(self, kind: str, text: str) -> None:
        """Add an event that happens here and now."""


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
        """This table and one more row."""
        return SkillTable((*self.rows, skill))

    def doing(self, **does: Callable[..., Any]) -> SkillTable:
        """The same skills, of which some do something else."""
        return SkillTable(tuple(s.doing(does[s.name]) if s.name in does else s for s in self.rows))

    @property
    def idle(self) -> frozenset[str]:
        """The skills that leave a robot and its world as they are."""
        return self._idle

    @property
    def verbs(self) -> Mapping[str, Verb]:
        """The verbs of events, by kind; kinds without a verb are absent."""
        return {s.recording.kind: s.verb for s in self.rows if s.recording and s.verb}


def skill(
    *,
    verb: Verb | None = None,
    event: str | None = "",
    text: str = "",
    names: str = "",
    to: str | None = None,
    when_tried: bool = False,
    ros: RosAction | None = None,
    seconds: float = 0.0,
    is_idle: bool = False,
) -> Callable[[Callable[..., Any]], Skill]:
    """Declare a skill by a function that does it to a robot, its first parameter.

    The other parameters, their annotations and the docstring are what programs and models see.

    Args:
        verb: for people.
        event: the kind of its event; by default the name of the function; None if it leaves no event.
        text: the parameter whose value is the text of the event; by default the first one that is a text.
        names: the sort of thing that the text names, such as `room`; empty for what is spoken.
        to: the parameter that says whom it is for.
        when_tried: whether an attempt that fails is an event, too.
        ros: the action on a robot.
        seconds: how long the simulated robot takes by its clock, besides driving.
        is_idle: whether it leaves the robot and its world as they are, however often it is executed.
    """

    def declared(does: Callable[..., Any]) -> Skill:
        code, annotations = does.__code__, {n: _written(a) for n, a in does.__annotations__.items()}
        named = code.co_varnames[1 : code.co_argcount]
        parameters = tuple(Parameter(name, TYPES[annotations[name]], annotations[name]) for name in named)
        lists = [each.name for each in parameters if each.type is list]
        texts = [each.name for each in parameters if each.type is str]
        recording = None
        if event is not None:
            options = lists[0] if lists else None
            recording = Recording(event or does.__name__, text or texts[0], options, to, names, when_tried)
        doc = (does.__doc__ or "").partition("\n")[0]
        row = (does.__name__, parameters, annotations["return"], doc, recording, ros, verb, seconds)
        return Skill(*row, is_idle=is_idle, does=does)

    return declared


def _written(annotation: object) -> str:
    """An annotation as it is written, which it is already where annotations are not evaluated."""
    return annotation.__name__ if type(annotation) is type else str(annotation)


TYPES: Mapping[str, type[str | list[object]]] = {"str": str, "list[str]": list}
"""What a program must pass, by the annotation of a parameter."""


# --- the eight skills of the paper (figure 2a)


def _verb(base: str, rest: str) -> Verb:
    return Verb(f"{base} {rest}", f"{base}s {rest}", f"{base}ed {rest}", f"{base}ing {rest}")


@skill(
    verb=_verb("look", "up where it is"),
    event=None,
    ros=RosAction("GetCurrentLocation", "/get_current_location_server", result="string"),
    is_idle=True,
)
def get_current_location(sim: Simulation) -> str:
    """Name the room the robot is in."""
    return sim.room


@skill(
    verb=_verb("look", "up which rooms there are"),
    event=None,
    ros=RosAction("GetAllRooms", "/get_all_rooms_server", result="string[]"),
    is_idle=True,
)
def get_all_rooms(sim: Simulation) -> list[str]:
    """List the names of all rooms."""
    return list(sim.rooms)


@skill(
    verb=Verb(
        *("look for", "looks for", "looked for", "looking for", "looked around"),
        results=("not found", "found"),
    ),
    event="check",
    names="object or person",
    ros=RosAction("IsInRoom", "/is_in_room_server", ("string object",), "bool"),
    seconds=1.0,
    is_idle=True,
)
def is_in_room(sim: Simulation, entity: str) -> bool:
    """Look whether an object or a person is in the room the robot is in."""
    return sim.look(entity)


@skill(
    verb=Verb("go to", "drives to", "went to", "going to"),
    event="goto",
    names="room",
    when_tried=True,
    ros=RosAction("GoTo", "/go_to_server", ("string location",), failure="GoToInvalidLocation"),
)
def go_to(sim: Simulation, location: str) -> None:
    """Drive to a room."""
    sim.drive(location)


@skill(
    verb=Verb("ask", "asks", "asked", "asking", "asked something"),
    text="question",
    to="person",
    when_tried=True,
    ros=RosAction("Ask", "/ask_server", ("string person", "string question", "string[] options"), "string"),
    seconds=3.0,
)
def ask(sim: Simulation, person: str, question: str, options: list[str]) -> str:
    """Ask a person in the same room a question and return the option that they choose."""
    chosen: str = sim.ask(person, question, options)  # by its position, since options may look alike
    return chosen


@skill(
    verb=Verb("say", "says", "said", "saying", "spoke"),
    when_tried=True,
    ros=RosAction("Say", "/say_server", ("string message",)),
    seconds=1.0,
    is_idle=True,
)
def say(sim: Simulation, message: str) -> None:
    """Say a message aloud in the room the robot is in."""
    sim.record("say", message)


@skill(
    verb=Verb("pick up", "picks up", "picked up", "picking up", "picked something up"),
    names="object",
    ros=RosAction("Pick", "/pick_server", ("string obj",)),
    seconds=5.0,
)
def pick(sim: Simulation, obj: str) -> None:
    """Pick up an object in the room; the robot can hold one at a time."""
    sim.take(obj)


@skill(
    verb=Verb("put down", "puts down", "put down", "putting down", "put something down"),
    names="object",
    ros=RosAction("Place", "/place_server", ("string obj",), failure="PlaceNoObject"),
    seconds=3.0,
)
def place(sim: Simulation, obj: str) -> None:
    """Put down the object that the robot holds."""
    sim.put(obj)


SKILLS = SkillTable((get_current_location, get_all_rooms, is_in_room, go_to, ask, say, pick, place))
"""The eight skills of the paper."""
