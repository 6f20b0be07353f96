"""A robot in an imagined world: its rooms are known, and all else is drawn when the program first asks."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.trace import Option
from codebotler.core.world import Room, World
from codebotler.simulator import robot as real
from codebotler.simulator.fact_sampler import Answer, Draw, FactSampler, Presence
from codebotler.simulator.robot import (
    Behaviour,
    RobotError,
    SimulatedRobot,
    Thing,
    found_in,
    is_found_by_itself,
)
from codebotler.simulator.rules import Rules

AS_WRITTEN = Rules(literals="as-written")
"""The rules for a program that a robot is to run: nothing in it is changed."""

SOMEBODY = "somebody"
PEOPLE = frozenset(
    {
        *("", SOMEBODY, "someone", "anybody", "anyone", "everybody", "everyone", "all"),
        *("person", "persons", "people", "human", "humans", "human being"),
        *("another person", "other person", "other people"),
    }
)
"""Words that mean whoever is there."""

AGREES = re.compile(r"\s*(?:yes|yeah|sure|ok)\b", re.IGNORECASE)

_ARTICLE = re.compile(r"(?:the|an?|any|some)\s+")


@dataclass(frozen=True)
class RoomMap:
    """What is known of a world before anything in it is imagined.

    Args:
        rooms: their names, in the order in which the robot knows them.
        start: the one in which the robot starts.
        guessed: whether nobody said which rooms there are. Names are then plain, and driving to a place that
            is not among them finds it.
        plain: whether names are plain texts, as robots have them, and no regexes, as world files do.
    """

    rooms: tuple[str, ...]
    start: str
    guessed: bool = False
    plain: bool = False

    @classmethod
    def of(cls, world: World) -> RoomMap:
        """The rooms of a world, and where the robot starts in it."""
        return cls(tuple(room.name for room in world.rooms), world.robot)

    def room(self, request: str) -> str | None:
        """The room that a request finds; None if there is no such room."""
        if not (self.guessed or self.plain):
            return next((room for room in self.rooms if found_in(room, request)), None)
        wanted = request.strip()
        same = [room for room in self.rooms if room.strip().casefold() == wanted.casefold()]
        within = (room for room in self.rooms if room.casefold() in wanted.casefold())
        return same[0] if same else next(within, (wanted or None) if self.guessed else None)

    @property
    def sure(self) -> tuple[str, ...]:
        """The rooms that their own names find."""
        is_plain = self.guessed or self.plain
        return tuple(room for room in self.rooms if is_plain or is_found_by_itself(room))


@dataclass(frozen=True)
class Whereabouts:
    """Whether somebody or something is in a room.

    Args:
        name: who or what, as `meant` names it.
        room: the room.
        is_there: whether it is there.
    """

    name: str
    room: str
    is_there: bool


@dataclass(frozen=True)
class Reply:
    """What somebody answers.

    Args:
        room: where the robot asks.
        question: which it asks.
        answer: which it is given.
    """

    room: str
    question: str
    answer: str


@dataclass(frozen=True)
class Fact:
    """Something that was settled about an imagined world.

    Args:
        sentence: it, in words.
        by_lot: whether it was drawn; else the program took it for granted, and so it was.
        about: what it says, for whoever says it in other words.
    """

    sentence: str
    by_lot: bool
    about: Whereabouts | Reply


@dataclass
class Scene:
    """What a program has found out about one room; names are those that `meant` gives.

    Args:
        missed: who or what it looked for, and was not there.
        gone: what it has taken away.
        people: who is there.
    """

    missed: set[str] = field(default_factory=set)
    gone: set[str] = field(default_factory=set)
    people: set[str] = field(default_factory=set)

    def lacks(self, name: str) -> bool:
        """Whether it is known not to be there; what a longer request did not find, a part of it does not."""
        return name in self.missed or any(name in missed for missed in self.missed if name != SOMEBODY)


@dataclass
class Hope:
    """Where a program looked for somebody or something.

    Args:
        vain: the rooms in which it found nothing.
        found: the rooms in which it found what it looked for.
    """

    vain: set[str] = field(default_factory=set)
    found: set[str] = field(default_factory=set)

    @property
    def is_lost(self) -> bool:
        """Whether it searched more than one room, and never found it."""
        return len(self.vain) > 1 and not self.found


class SampledRobot(SimulatedRobot):
    """A robot in a world that is drawn while the program runs; a fact once drawn stays true.

    What the program looks for is there or not by chance. What it never looked for is as it takes it to be:
    somebody answers, and what it picks up lies there. Answers are drawn from what a question offers.

    A search of several rooms takes for granted that there is one of what it searches. Where the lots fell
    otherwise, `excuses` tells which errors are owed to that, so that nobody blames the program.

    Args:
        plan: the rooms, which are certain.
        lot: how facts are drawn.
        rules: how requests find rooms.
        skills: the skills that can be called.
        behaviours: what each skill does, by name.
    """

    def __init__(
        self,
        plan: RoomMap,
        lot: FactSampler,
        rules: Rules = AS_WRITTEN,
        skills: SkillTable = SKILLS,
        behaviours: Mapping[str, Behaviour] | None = None,
    ) -> None:
        does = IMAGINED if behaviours is None else behaviours
        super().__init__(World(tuple(map(Room, plan.rooms)), plan.start), rules, skills, does)
        self.plan, self.lot = plan, lot
        self.only_looks |= {name for name, behaviour in does.items() if behaviour is look}
        if does.get("go_to") is drive:
            self.surely = tuple(("go_to", room) for room in plan.sure)
        self.things = defaultdict(list)
        self.people = defaultdict(list)  # of nobody whom a world file would name
        self.scenes: defaultdict[str, Scene] = defaultdict(Scene)
        self.told: dict[tuple[str, ...], str] = {}
        self.facts: list[Fact] = []
        self.draws: list[Draw] = []
        self.hopes: defaultdict[str, Hope] = defaultdict(Hope)
        self.excuses: set[str] = set()

    def hope(self, name: str) -> Hope:
        """Where the program looked for somebody or something, also by a longer or a shorter name."""
        found = Hope()
        for looked, hope in self.hopes.items():
            if looked == name or (SOMEBODY not in {looked, name} and (looked in name or name in looked)):
                found.vain |= hope.vain
                found.found |= hope.found
        return found

    @contextmanager
    def excused(self, *, when: bool) -> Iterator[None]:
        """Remember what an error says that is owed to the lots and not to the program."""
        try:
            yield
        except RobotError as error:
            if when and not self.lot.strict:
                self.excuses.add(str(error))
            raise

    @property
    def scene(self) -> Scene:
        """What the program has found out about the room that the robot is in."""
        return self.scenes[self.room]

    def is_here(self, name: str) -> bool | None:
        """Whether somebody or something is in this room, as `meant` names it; None if nothing says so yet."""
        things = self.things[self.room] if name != SOMEBODY else []
        if name in self.scene.people or any(thing.is_meant_by(name) for thing in things):
            return True
        return False if self.scene.lacks(name) else None

    def drawn(self, name: str) -> bool:
        """Draw whether somebody or something is in this room."""
        here = self.lot.is_there(self.room, name)
        self.draws.append(Presence(self.room, name, here))
        return here

    def answered(self, options: Sequence[str], *question: str) -> str:
        """Draw the answer to a question."""
        agreeing = next((i for i, text in enumerate(options) if AGREES.match(text)), 0)
        drawn = self.lot.answer(len(options), agreeing, *question)
        self.draws.append(Answer(len(options), agreeing, question, drawn))
        return options[drawn]

    def settle(self, name: str, *, here: bool, by_lot: bool) -> None:
        """Let somebody or something be in this room or not, from now on."""
        if name == SOMEBODY:
            told = f"{SOMEBODY} is" if here else "nobody is"
        else:
            told = f'"{brief(name)}" is' if here else f'"{brief(name)}" is not'
        about = Whereabouts(name, self.room, here)
        self.facts.append(Fact(f'{told} in "{brief(self.room)}"', by_lot, about))
        if not here:
            self.scene.missed.add(name)


def meant(request: str) -> str:
    """Who or what a request means: without an article, and the same for all words for people."""
    name = " ".join(request.casefold().split())
    name = name.removeprefix(found[0]) if (found := _ARTICLE.match(name)) else name
    return SOMEBODY if name in PEOPLE else name


def is_name(request: str) -> bool:
    """Whether a request names a person, as far as its spelling tells; whoever is found by it is somebody."""
    return request.strip()[:1].isupper()


def drive(robot: SampledRobot, location: str) -> None:
    """Drive to the first room whose name is found in the request, or to one that nobody ever named."""
    robot.record("goto", location)
    room = robot.plan.room(location)
    if room is None:
        raise RobotError("GoToInvalidLocation", f'there is no room "{location}"')
    robot.room = room


def look(robot: SampledRobot, entity: str) -> bool:
    """Look for an object or for somebody; whether they are there is drawn at the first look."""
    name = meant(entity)
    here = robot.is_here(name)
    if here is None and (name in robot.scene.gone or (is_name(entity) and robot.scene.lacks(SOMEBODY))):
        here = False
        robot.scene.missed.add(name)
    if here is None:
        here = robot.drawn(name)
        robot.settle(name, here=here, by_lot=True)
        if here and (name == SOMEBODY or is_name(entity)):
            robot.scene.people |= {name, SOMEBODY}
        if here and name != SOMEBODY:
            robot.things[robot.room].append(Thing(name, is_pattern=False))
    (robot.hopes[name].found if here else robot.hopes[name].vain).add(robot.room)
    robot.record("check", entity, found=here)
    return here


def ask(robot: SampledRobot, person: str, question: str, options: tuple[Option, ...]) -> int:
    """Ask somebody, who is there unless the program saw that they are not; they choose by chance."""
    who = meant(person)
    if not options or not _answers(robot, who):
        lost = robot.hope(who).is_lost or robot.hope(SOMEBODY).is_lost
        with robot.excused(when=bool(options) and lost):
            return real.ask(robot, person, question, options)
    robot.record("ask", question, options)
    asked = (robot.room, who, question.strip())
    texts = [option.text for option in options]
    if robot.told.get(asked) not in texts:
        drawn = robot.answered(texts, *asked)
        robot.told[asked] = drawn
        where = f'in "{brief(robot.room)}" to "{brief(question)}"'
        about = Reply(robot.room, question, drawn)
        robot.facts.append(Fact(f'the answer {where} is "{brief(drawn)}"', by_lot=True, about=about))
    chosen = texts.index(robot.told[asked])
    robot.amend(texts[chosen])
    return chosen


def _answers(robot: SampledRobot, who: str) -> bool:
    here = robot.is_here(who)
    if here is None and robot.scene.lacks(SOMEBODY):
        here = False
    if here is None:
        here = robot.drawn(who) if robot.lot.strict else True
        robot.settle(who, here=here, by_lot=robot.lot.strict)
    if here:
        robot.scene.people |= {who, SOMEBODY}
    return here


def pick(robot: SampledRobot, obj: str) -> None:
    """Take an object, which is there unless the program saw that it is not."""
    name = meant(obj)
    if robot.held is None and robot.is_here(name) is None and _lies_there(robot, name):
        robot.things[robot.room].append(Thing(name, is_pattern=False))
    hope = robot.hope(name)
    again = robot.held is not None and meant(robot.held) == name and len(hope.found) > 1
    with robot.excused(when=again or hope.is_lost):
        real.pick(robot, obj)
    robot.scene.gone.add(name)
    robot.scene.people.discard(name)


def _lies_there(robot: SampledRobot, name: str) -> bool:
    if name in robot.scene.gone:  # it may have been one of several, if nobody has looked since
        return not robot.lot.strict
    here = robot.drawn(name) if robot.lot.strict else True
    robot.settle(name, here=here, by_lot=robot.lot.strict)
    return here


def place(robot: SampledRobot, obj: str) -> None:
    """Put down what the robot holds, which must be named exactly as it was picked up."""
    with robot.excused(when=robot.held is None and robot.hope(meant(obj)).is_lost):
        real.place(robot, obj)


IMAGINED: Mapping[str, Behaviour] = {
    **real.BEHAVIOURS,
    "go_to": drive,
    "is_in_room": look,
    "ask": ask,
    "pick": pick,
    "place": place,
}
"""What each of the eight skills does in an imagined world."""

BRIEF = 80


def brief(text: str) -> str:
    """A text of a program, on one line and without what is too long for a sentence."""
    line = " ".join(text.split())
    return line if len(line) <= BRIEF else f"{line[:BRIEF]}..."
