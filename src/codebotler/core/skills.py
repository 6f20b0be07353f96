"""The skill table: what a robot can do, from its Python signature to its ROS action and its verbs.

Prompts, messages, checks and robots read it; what a skill does to a world is in `codebotler.simulator.robot`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field


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
    """

    name: str
    parameters: tuple[Parameter, ...]
    returns: str
    doc: str
    recording: Recording | None = None
    ros: RosAction | None = None
    verb: Verb | None = None
    seconds: float = 0.0

    @property
    def signature(self) -> str:
        """The skill as a Python signature, such as `go_to(location: str) -> None`."""
        arguments = ", ".join(f"{p.name}: {p.annotation}" for p in self.parameters)
        return f"{self.name}({arguments}) -> {self.returns}"


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

    def __post_init__(self) -> None:
        by_name = {skill.name: skill for skill in self.rows}
        kinds = [skill.recording.kind for skill in self.rows if skill.recording]
        if len(by_name) != len(self.rows) or len(set(kinds)) != len(kinds):
            raise ValueError("two skills share a name or a kind of event")
        object.__setattr__(self, "_by_name", by_name)
        recordings = {skill.recording.kind: skill.recording for skill in self.rows if skill.recording}
        object.__setattr__(self, "recordings", recordings)
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

    @property
    def verbs(self) -> Mapping[str, Verb]:
        """The verbs of events, by kind; kinds without a verb are absent."""
        return {s.recording.kind: s.verb for s in self.rows if s.recording and s.verb}


def _verb(base: str, rest: str) -> Verb:
    return Verb(f"{base} {rest}", f"{base}s {rest}", f"{base}ed {rest}", f"{base}ing {rest}")


SKILLS = SkillTable(
    (
        Skill(
            "get_current_location",
            (),
            "str",
            "Name the room the robot is in.",
            ros=RosAction("GetCurrentLocation", "/get_current_location_server", result="string"),
            verb=_verb("look", "up where it is"),
        ),
        Skill(
            "get_all_rooms",
            (),
            "list[str]",
            "List the names of all rooms.",
            ros=RosAction("GetAllRooms", "/get_all_rooms_server", result="string[]"),
            verb=_verb("look", "up which rooms there are"),
        ),
        Skill(
            "is_in_room",
            (Parameter("entity"),),
            "bool",
            "Look whether an object or a person is in the room the robot is in.",
            Recording("check", "entity", names="object or person"),
            RosAction("IsInRoom", "/is_in_room_server", ("string object",), "bool"),
            Verb(
                *("look for", "looks for", "looked for", "looking for", "looked around"),
                results=("not found", "found"),
            ),
            seconds=1.0,
        ),
        Skill(
            "go_to",
            (Parameter("location"),),
            "None",
            "Drive to a room.",
            Recording("goto", "location", names="room", when_tried=True),
            RosAction("GoTo", "/go_to_server", ("string location",), failure="GoToInvalidLocation"),
            Verb("go to", "drives to", "went to", "going to"),
        ),
        Skill(
            "ask",
            (Parameter("person"), Parameter("question"), Parameter("options", list, "list[str]")),
            "str",
            "Ask a person in the same room a question and return the option that they choose.",
            Recording("ask", "question", "options", to="person", when_tried=True),
            RosAction(
                "Ask", "/ask_server", ("string person", "string question", "string[] options"), "string"
            ),
            Verb("ask", "asks", "asked", "asking", "asked something"),
            seconds=3.0,
        ),
        Skill(
            "say",
            (Parameter("message"),),
            "None",
            "Say a message aloud in the room the robot is in.",
            Recording("say", "message", when_tried=True),
            RosAction("Say", "/say_server", ("string message",)),
            Verb("say", "says", "said", "saying", "spoke"),
            seconds=1.0,
        ),
        Skill(
            "pick",
            (Parameter("obj"),),
            "None",
            "Pick up an object in the room; the robot can hold one at a time.",
            Recording("pick", "obj", names="object"),
            RosAction("Pick", "/pick_server", ("string obj",)),
            Verb("pick up", "picks up", "picked up", "picking up", "picked something up"),
            seconds=5.0,
        ),
        Skill(
            "place",
            (Parameter("obj"),),
            "None",
            "Put down the object that the robot holds.",
            Recording("place", "obj", names="object"),
            RosAction("Place", "/place_server", ("string obj",), failure="PlaceNoObject"),
            Verb("put down", "puts down", "put down", "putting down", "put something down"),
            seconds=3.0,
        ),
    )
)
"""The eight skills of the paper."""
