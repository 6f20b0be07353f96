"""The simulated robot: what each skill does to a world, and how it can fail."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

from codebotler.simulator.rules import PAPER, Rules
from codebotler.skills import SKILLS, SkillTable
from codebotler.trace import Event, Option, Trace
from codebotler.world import World


class RobotError(Exception):
    """The robot cannot do what it was asked to do.

    Args:
        kind: one of the seven kinds of the taxonomy (paper, section V.B, and AskInvalidOptions).
        message: why, in a sentence.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


Argument: TypeAlias = str | tuple[Option, ...]
Result: TypeAlias = str | list[str] | bool | int | None
Behaviour: TypeAlias = Callable[..., Result]


@dataclass
class Thing:
    """An object in a room; one that was put down keeps the name it was picked by, as literal text."""

    label: str
    is_pattern: bool = True

    def is_meant_by(self, request: str) -> bool:
        """Whether a request finds it."""
        if self.is_pattern:
            return found_in(self.label, request)
        return self.label.lower() in request.lower()  # a regex would take minutes for names that are long


class SimulatedRobot:
    """A robot in its own copy of a world, with the trace of what it has done.

    Args:
        world: the initial state; it is not changed.
        rules: how requests are matched.
        skills: the skills that can be called.
        behaviours: what each skill does, by name.
    """

    def __init__(
        self,
        world: World,
        rules: Rules = PAPER,
        skills: SkillTable = SKILLS,
        behaviours: Mapping[str, Behaviour] | None = None,
    ) -> None:
        self.rules, self.skills = rules, skills
        self.behaviours = BEHAVIOURS if behaviours is None else behaviours
        self.never_fails = frozenset(name for name, does in self.behaviours.items() if does is say)
        self.only_looks = frozenset(name for name, does in self.behaviours.items() if does in LOOKING)
        self.rooms = tuple(room.name for room in world.rooms)
        self.surely = sure_drives(self.rooms) if self.behaviours.get("go_to") is go_to else ()
        self.room = world.robot
        self.things = {room.name: [Thing(label) for label in room.objects] for room in world.rooms}
        self.answers = {room.name: [list(person.answers) for person in room.people] for room in world.rooms}
        self.held: str | None = None
        self.now, self.is_live = 0.0, False
        self.events: list[Event] = []

    @property
    def trace(self) -> Trace:
        """What the robot has done so far."""
        return tuple(self.events)

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute one skill.

        Args:
            skill: its name in the skill table.
            arguments: texts; the options of a question as a tuple of `Option`.

        Returns:
            what the skill returns; for a question the position of the chosen option.

        Raises:
            RobotError: the robot cannot do it.
        """
        return self.behaviours[skill](self, *arguments)

    def sleep_until(self, now: float) -> None:
        """Let simulated time pass, until `now` seconds since the start."""
        self.now = now

    def record(
        self, kind: str, text: str, options: tuple[Option, ...] = (), *, found: bool | None = None
    ) -> None:
        """Add an event that happens here and now; the text loses the spaces at its ends."""
        self.events.append(Event(kind, text.strip(), options, None, found, self.room, self.now))

    def amend(self, answer: str) -> None:
        """Add to the last event what was answered."""
        self.events[-1] = replace(self.events[-1], answer=answer)


def found_in(label: str, request: str) -> bool:
    """Whether a label of the world, a regex, is found in what the program asked for."""
    return _pattern(label).search(request) is not None


@lru_cache(maxsize=4096)
def _pattern(label: str) -> re.Pattern[str]:
    return re.compile(label, re.IGNORECASE | re.DOTALL)


def get_current_location(robot: SimulatedRobot) -> str:
    """Name the room, as the world does and not as it was asked for."""
    return robot.room


def get_all_rooms(robot: SimulatedRobot) -> list[str]:
    """List the rooms in the order of the world, the start included."""
    return list(robot.rooms)


def go_to(robot: SimulatedRobot, location: str) -> None:
    """Drive to the first room whose name is found in the request."""
    robot.record("goto", location)
    room = resolve_room(robot.rooms, location)
    if room is None:
        raise RobotError("GoToInvalidLocation", f'there is no room "{location}"')
    robot.room = room


@lru_cache(maxsize=4096)
def sure_drives(rooms: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    """The drives that succeed whatever happens: to each room by its name, unless it is an odd regex."""
    return tuple(("go_to", room) for room in rooms if is_found_by_itself(room))


def is_found_by_itself(room: str) -> bool:
    """Whether the name of a room is found in itself."""
    try:
        return found_in(room, room)
    except re.error:
        return False


def resolve_room(rooms: Sequence[str], request: str) -> str | None:
    """The first room whose name is found in a request."""
    return next((room for room in rooms if found_in(room, request)), None)


def is_in_room(robot: SimulatedRobot, entity: str) -> bool:
    """Look for an object, else for a person; in the paper's suite people answer to any name."""
    seen = any(thing.is_meant_by(entity) for thing in robot.things[robot.room])
    seen = seen or bool(robot.answers[robot.room])
    robot.record("check", entity, found=seen)
    return seen


def say(robot: SimulatedRobot, message: str) -> None:
    """Speak; nobody need be there."""
    robot.record("say", message)


def ask(robot: SimulatedRobot, _person: str, question: str, options: tuple[Option, ...]) -> int:
    """Ask somebody here, whoever was meant, and return the position of the option they choose."""
    robot.record("ask", question, options)
    if not options:
        raise RobotError("AskEmptyOptions", f'the question "{question}" offers no options')
    if not robot.answers[robot.room]:
        raise RobotError("AskNoPerson", f'nobody is in "{robot.room}" to be asked "{question}"')
    answers = robot.answers[robot.room][0]
    chosen = choose(answers[0], question, options) if answers else None
    if len(answers) > 1:  # the last answer stays for ever
        del answers[0]
    if chosen is None:
        offered = ", ".join(option.text for option in options)
        raise RobotError(
            "AskInvalidOptions", f'none of the options ({offered}) fits the answer to "{question}"'
        )
    robot.amend(options[chosen].text)
    return chosen


def choose(answer: str, question: str, options: tuple[Option, ...]) -> int | None:
    """The position of the option that an answer means.

    The answer is looked for in the options; failing that it is a yes or a no to the question.
    """

    def first(pattern: str) -> int | None:
        return next((i for i, option in enumerate(options) if found_in(pattern, option.text)), None)

    direct = first(answer)
    if direct is not None:
        return direct
    return first("yes" if found_in(answer, question) else "no")


def pick(robot: SimulatedRobot, obj: str) -> None:
    """Take the first object here that the request finds."""
    if robot.held is not None:
        raise RobotError(
            "PickWhileHolding", f'the robot holds "{robot.held}" and cannot pick up "{obj}" as well'
        )
    here = robot.things[robot.room]
    thing = next((thing for thing in here if thing.is_meant_by(obj)), None)
    if thing is None:
        raise RobotError("PickInvalidObject", f'there is no "{obj}" in "{robot.room}"')
    here.remove(thing)
    robot.held = obj
    robot.record("pick", obj)


def place(robot: SimulatedRobot, obj: str) -> None:
    """Put down what the robot holds, which must be named exactly as it was picked up."""
    if robot.held is None or robot.held != obj:
        holds = "nothing" if robot.held is None else f'"{robot.held}"'
        raise RobotError("PlaceNoObject", f'the robot cannot place "{obj}": it holds {holds}')
    robot.things[robot.room].append(Thing(obj, is_pattern=False))
    robot.held = None
    robot.record("place", obj)


BEHAVIOURS: Mapping[str, Behaviour] = {
    "get_current_location": get_current_location,
    "get_all_rooms": get_all_rooms,
    "is_in_room": is_in_room,
    "go_to": go_to,
    "ask": ask,
    "say": say,
    "pick": pick,
    "place": place,
}
"""What each of the eight skills does."""


LOOKING = (get_current_location, get_all_rooms, is_in_room)
"""Behaviours that change nothing, and whose result stays the same until the robot acts."""


def located(trace: Trace, world: World) -> Trace:
    """The trace with the place of each event, found by driving through the world again."""
    rooms = [room.name for room in world.rooms]
    here, events = world.robot, []
    for event in trace:
        events.append(replace(event, place=here))
        if event.kind == "goto":
            here = resolve_room(rooms, event.text) or here
    return tuple(events)
