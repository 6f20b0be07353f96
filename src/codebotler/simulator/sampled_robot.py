"""A robot in a sampled world: its rooms are known, and all else is drawn when the program first asks."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TypeAlias

from codebotler.core.errors import RobotError
from codebotler.core.skills.kinds import ASK, CHECK, GOTO
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.skills.values import as_text
from codebotler.core.trace import to_options
from codebotler.core.unicode import compose_fields
from codebotler.core.words import brief
from codebotler.core.world import Room, World, laid_out
from codebotler.simulator.fact_sampler import Draw, FactSampler
from codebotler.simulator.robot import SimulatedRobot, SkillGuard, Thing, no_room, own_skills
from codebotler.simulator.settings import SimulationSettings, finds

AS_WRITTEN = SimulationSettings(literals="as-written")  # leaves a program unchanged, as a robot will run it

SOMEBODY = "somebody"
PEOPLE = frozenset(  # words that mean whoever is there
    {
        *("", SOMEBODY, "someone", "anybody", "anyone", "everybody", "everyone", "all"),
        *("person", "persons", "people", "human", "humans", "human being"),
        *("another person", "other person", "other people"),
    }
)
AGREES = re.compile(r"\s*(?:yes|yeah|sure|ok)\b", re.IGNORECASE)
_ARTICLE = re.compile(r"(?:the|an?|any|some)\s+")


@dataclass(frozen=True)
class RoomMap:
    """What is known of a world before anything in it is sampled."""

    rooms: tuple[str, ...]  # in the order in which the robot knows them
    start: str
    guessed: bool = False  # nobody said which rooms there are: driving to any other place finds it, too
    plain: bool = False  # names are plain texts, as robots and guesses have them, and no regexes
    plan: tuple[Room, ...] = ()  # footprints; and where the robot stops, if it drives straight between rooms

    def __post_init__(self) -> None:
        compose_fields(self)

    @classmethod
    def of(cls, world: World) -> RoomMap:
        """The rooms of a world, and where the robot starts in it."""
        plan = [Room(room.name, (), (), room.footprint, room.stand_at) for room in laid_out(world).rooms]
        return cls(tuple(room.name for room in world.rooms), world.robot, plan=tuple(plan))

    @classmethod
    def of_places(cls, world: World) -> RoomMap:
        """The places of a robot that finds its own ways between them, beginning at the first."""
        names = tuple(room.name for room in world.rooms)
        plan = tuple(Room(room.name, (), (), room.footprint) for room in world.rooms)
        return cls(names, names[0], plain=True, plan=plan)

    def room(self, request: str) -> str | None:
        """The room that a request finds; None if there is no such room."""
        if not (self.guessed or self.plain):
            return next((r for r in self.rooms if finds(request, r, "label-in-request")), None)
        wanted = request.strip()
        same = [room for room in self.rooms if room.strip().casefold() == wanted.casefold()]
        within = (room for room in self.rooms if room.casefold() in wanted.casefold())
        return same[0] if same else next(within, (wanted or None) if self.guessed else None)

    def rooms_meant(self, request: str) -> list[str]:
        """All known rooms that a request may mean: only those where it leads, if it is the name of one."""
        wanted, leads_to = request.strip().casefold(), self.room(request)
        named = [room for room in self.rooms if room.strip().casefold() == wanted]
        if named:
            return [*named, *([] if leads_to is None or leads_to in named else [leads_to])]
        if self.guessed or self.plain:
            return [room for room in self.rooms if room.strip().casefold() in wanted]
        return [room for room in self.rooms if finds(request, room, "label-in-request")]


# --- facts


@dataclass(frozen=True)
class Whereabouts:
    """The fact that somebody or something is in a room or not."""

    name: str  # as `meant` names it
    room: str
    is_there: bool
    by_lot: bool = True  # drawn; else the program took it for granted, and so it was

    @property
    def sentence(self) -> str:
        """It, in words."""
        if self.name == SOMEBODY:
            subject = f"{SOMEBODY} is" if self.is_there else "nobody is"
        else:
            subject = f'"{brief(self.name)}" is' if self.is_there else f'"{brief(self.name)}" is not'
        return f'{subject} in "{brief(self.room)}"'


@dataclass(frozen=True)
class GivenAnswer:
    """The fact that somebody answers a question in some way."""

    room: str
    question: str
    answer: str
    by_lot: bool = True

    @property
    def sentence(self) -> str:
        """It, in words."""
        where = f'in "{brief(self.room)}" to "{brief(self.question)}"'
        return f'the answer {where} is "{brief(self.answer)}"'


@dataclass(frozen=True)
class Lot:
    """The fact that a statement is true or not, or that a skill comes to something."""

    statement: str
    outcome: str
    by_lot: bool = True

    @property
    def sentence(self) -> str:
        """It, in words."""
        return f"{brief(self.statement)} {self.outcome}"


Fact: TypeAlias = Whereabouts | GivenAnswer | Lot


# --- what a program has found out; names are those that `meant` gives


@dataclass
class ExploredRoom:
    """What a program has found out about one room."""

    missed: set[str] = field(default_factory=set)  # what it looked for in vain
    gone: set[str] = field(default_factory=set)  # what it has taken away
    people: set[str] = field(default_factory=set)

    def lacks(self, name: str) -> bool:
        """Whether it is known not to be there; what a longer request did not find, a part of it does not."""
        return name in self.missed or any(name in missed for missed in self.missed if name != SOMEBODY)


@dataclass
class Search:
    """The rooms in which a program looked for somebody or something, in vain or not."""

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

    A search of several rooms takes for granted that there is one of what it searches. Where that was not
    drawn, `excuses` holds the errors that are owed to it, so that nobody blames the program.
    """

    def __init__(
        self,
        room_map: RoomMap,
        sampler: FactSampler,
        rules: SimulationSettings = AS_WRITTEN,
        skills: SkillTable = SKILLS,
        *,
        guard: SkillGuard | None = None,
    ) -> None:
        world = World(tuple(map(Room, room_map.rooms)), room_map.start)
        super().__init__(world, rules, skills, guard=guard)
        self.setup = "sampled", (room_map, sampler, rules)
        self.room_map, self.sampler = room_map, sampler
        self.things = defaultdict(list)
        self.people = defaultdict(list)  # of nobody whom a world file would name
        self.explored: defaultdict[str, ExploredRoom] = defaultdict(ExploredRoom)
        self.answers: dict[tuple[str, ...], str] = {}  # by room, person and question
        self.lots: dict[str, int] = {}  # outcomes of statements
        self.facts: list[Fact] = []
        self.draws: list[Draw] = []
        self.searches: defaultdict[str, Search] = defaultdict(Search)
        self.excuses: set[str] = set()  # messages of errors

    @property
    def own_skills(self) -> tuple[str, ...]:
        """The skills that a copy made from `setup` would not have."""
        return own_skills(self, SampledRobot)

    @property
    def idle_skills(self) -> frozenset[str]:
        """The skills that leave the robot and its world as they are, once the first has drawn its facts."""
        return self.skills.idle

    def meant_rooms(self, request: str) -> Sequence[str]:
        """All rooms that a request may mean."""
        return self.room_map.rooms_meant(request)

    @property
    def here(self) -> ExploredRoom:
        """What the program has found out about the room that the robot is in."""
        return self.explored[self.room]

    def search(self, name: str) -> Search:
        """Where the program looked for somebody or something, also by a longer or a shorter name."""
        all_of_them = Search()
        for sought, search in self.searches.items():
            if sought == name or (SOMEBODY not in {sought, name} and (sought in name or name in sought)):
                all_of_them.vain |= search.vain
                all_of_them.found |= search.found
        return all_of_them

    @contextmanager
    def excused(self, *, when: bool) -> Iterator[None]:
        """Excuse an error that is owed to what was drawn and not to the program."""
        try:
            yield
        except RobotError as error:
            if when and not self.sampler.strict:
                self.excuses.add(str(error))
            raise

    def is_here(self, name: str) -> bool | None:
        """Whether somebody or something is in this room; None if that is not settled yet."""
        things = self.things[self.room] if name != SOMEBODY else []
        if name in self.here.people or any(thing.is_meant_by(name) for thing in things):
            return True
        return False if self.here.lacks(name) else None

    def settle(self, name: str, *, by_lot: bool) -> bool:
        """Settle whether somebody or something is in this room: by a draw, or as the program takes it."""
        is_there = True
        if by_lot:
            is_there = self.sampler.is_there(self.room, name)
            self.draws.append(Draw("is_there", (self.room, name), is_there))
        self.facts.append(Whereabouts(name, self.room, is_there, by_lot))
        if not is_there:
            self.here.missed.add(name)
        return is_there

    def answer(self, options: Sequence[str], *question: str) -> str:
        """Draw the answer to a question."""
        agreeing = next((i for i, text in enumerate(options) if AGREES.match(text)), 0)
        drawn = self.sampler.answer(len(options), agreeing, *question)
        self.draws.append(Draw("answer", (len(options), agreeing, *question), drawn))
        return options[drawn]

    def lot(self, statement: str, outcomes: Sequence[str], errors: Sequence[str] = ()) -> int:
        """Draw which of some outcomes a statement has, once."""
        possible = [*outcomes, *errors]
        if statement not in self.lots:
            drawn = self.sampler.outcome(len(possible), statement)
            self.draws.append(Draw("outcome", (len(possible), statement), drawn))
            self.facts.append(Lot(statement, possible[drawn]))
            self.lots[statement] = drawn
        return self.lots[statement]

    # --- what skills do

    def drive(self, location: str) -> None:
        """Drive to the first room whose name is found in the request, or to one that nobody ever named."""
        room = self.room_for(location)
        self.record(GOTO, location, destination=room)
        if room is None:
            raise no_room(location)
        self.room = room

    def room_for(self, request: str) -> str | None:
        """The room that a request finds, which may be one that nobody ever named."""
        return self.room_map.room(request)

    def look(self, entity: str) -> bool:
        """Look for an object or for somebody; whether they are there is drawn at the first look."""
        name, room = meant(entity), self.here
        found = self.is_here(name)
        if found is None and (name in room.gone or (is_name(entity) and room.lacks(SOMEBODY))):
            found = False
            room.missed.add(name)
        if found is None:
            found = self.settle(name, by_lot=True)
            if found and (name == SOMEBODY or is_name(entity)):
                room.people |= {name, SOMEBODY}
            if found and name != SOMEBODY:
                self.things[self.room].append(Thing(name, is_pattern=False))
        search = self.searches[name]
        (search.found if found else search.vain).add(self.room)
        self.record(CHECK, entity, found=found)
        return found

    def ask(self, person: str, question: str, options: Sequence[object]) -> int:
        """Ask somebody, who is there unless the program saw that they are not; they choose by chance."""
        person, options = as_text(person), to_options(options)
        who = meant(person)
        if not options or not self._answers(who):
            lost = self.search(who).is_lost or self.search(SOMEBODY).is_lost
            with self.excused(when=bool(options) and lost):
                return super().ask(person, question, options)
        self.record(ASK, question, options, to=person)
        asked = (self.room, who, question.strip())
        texts = [option.text for option in options]
        if self.answers.get(asked) not in texts:
            self.answers[asked] = self.answer(texts, *asked)
            self.facts.append(GivenAnswer(self.room, question, self.answers[asked]))
        chosen = texts.index(self.answers[asked])
        self.amend(texts[chosen])
        return chosen

    def _answers(self, who: str) -> bool:
        is_there = self.is_here(who)
        if is_there is None and self.here.lacks(SOMEBODY):
            is_there = False
        if is_there is None:
            is_there = self.settle(who, by_lot=self.sampler.strict)
        if is_there:
            self.here.people |= {who, SOMEBODY}
        return is_there

    def take(self, obj: str) -> None:
        """Take an object, which is there unless the program saw that it is not."""
        name = meant(obj)
        if self.held is None and self.is_here(name) is None and self._lies_there(name):
            self.things[self.room].append(Thing(name, is_pattern=False))
        search = self.search(name)
        again = self.held is not None and meant(self.held) == name and len(search.found) > 1
        with self.excused(when=again or search.is_lost):
            super().take(obj)
        self.here.gone.add(name)
        self.here.people.discard(name)

    def _lies_there(self, name: str) -> bool:
        if name in self.here.gone:  # it may have been one of several, if nobody has looked since
            return not self.sampler.strict
        return self.settle(name, by_lot=self.sampler.strict)

    def put(self, obj: str) -> None:
        """Put down what the robot holds, which must be named exactly as it was picked up."""
        with self.excused(when=self.held is None and self.search(meant(obj)).is_lost):
            super().put(obj)


def meant(request: str) -> str:
    """Who or what a request means: without an article, and the same for all words for people."""
    name = " ".join(request.casefold().split())
    name = name.removeprefix(found[0]) if (found := _ARTICLE.match(name)) else name
    return SOMEBODY if name in PEOPLE else name


def is_name(request: str) -> bool:
    """Whether a request names a person, as far as its spelling tells; whoever is found by it is somebody."""
    return request.strip()[:1].isupper()
