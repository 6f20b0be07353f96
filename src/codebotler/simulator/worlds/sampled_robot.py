"""A robot in a sampled world: its rooms are known, and each other fact is chosen at random when needed."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Literal

from codebotler.core.errors import RobotError
from codebotler.core.skills.kinds import ASK, CHECK, PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.skills.values import as_text
from codebotler.core.trace import Event, to_options
from codebotler.core.world import Room, World
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worlds.entities import NO_WORDS, Thing
from codebotler.simulator.worlds.fact_sampler import Draw, DrawMethod, FactSampler
from codebotler.simulator.worlds.matching import (
    SOMEBODY,
    WORDS_FOR_PEOPLE,
    WORDS_FOR_THINGS,
    Entity,
    best_fits,
    contains,
    means_anybody,
    means_person,
    meant_by,
    normalized,
)
from codebotler.simulator.worlds.robot import SimulatedRobot, SkillGuard
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.simulator.worlds.sampled_facts import (
    ANSWER_FORM,
    ExploredRoom,
    RoomSearch,
    SampledFact,
    whereabouts,
)
from codebotler.simulator.worlds.simulated_world import NO_SUCH_THING

AS_WRITTEN = SimulationSettings(literals="as-written", matching="longest-name")  # as on a robot
AGREEING_TEXT = re.compile(r"\s*(?:yes|yeah|sure|ok)\b", re.IGNORECASE)


class SampledRobot(SimulatedRobot):
    """A robot in a world whose facts are chosen at random while the program runs, and then never change.

    If the program looks for a person or thing, their presence is random. Otherwise, the program's assumptions
    hold: a person answers, and a thing can be picked up. Answers are random options.
    A program that searches several rooms assumes that the thing is in one of them. If the thing is in none,
    `excuses` holds the resulting errors, which are not the program's fault.
    What the robot last saw before the program began (`RoomMap.past`) is true until the program waits.
    """

    is_copied = True

    def __init__(
        self,
        room_map: RoomMap,
        sampler: FactSampler,
        settings: SimulationSettings = AS_WRITTEN,
        skills: SkillTable = SKILLS,
        *,
        guard: SkillGuard | None = None,
    ) -> None:
        rooms = [*map(Room, room_map.rooms), *(Room(place, within=room) for place, room in room_map.places)]
        world = World(tuple(rooms), room_map.start, traits=room_map.traits)
        super().__init__(world, settings, skills, guard=guard)
        self.setup = "sampled", (room_map, sampler, settings)
        self.room_map, self.sampler = room_map, sampler
        self.contents, self.occupants = defaultdict(list), defaultdict(list)  # no world file names occupants
        self.explored: defaultdict[str, ExploredRoom] = defaultdict(ExploredRoom)
        self.answers: dict[tuple[str, ...], str] = {}  # answers by room, person and question
        self.questions = defaultdict[tuple[str, ...], list[tuple[str, ...]]](list)  # by room and options
        self.outcomes: dict[str, int] = {}  # outcomes by statement
        self.facts: list[SampledFact] = []
        self.draws: list[Draw] = []
        self.searches: defaultdict[str, RoomSearch] = defaultdict(RoomSearch)
        self.excuses: set[str] = set()  # messages of excused errors
        self.has_assumed = False  # whether a fact holds that strict worlds would draw
        for event in room_map.past:
            self._recall(event)
        self.recalled = {room: (one.people.copy(), one.missed.copy()) for room, one in self.explored.items()}
        self.room, self.since = world.robot, ""  # since when new facts hold, if not from the beginning

    @property
    def idle_skills(self) -> frozenset[str]:
        """The names of the skills that change neither the robot nor its world once their facts are chosen."""
        return self.skills.idle

    def possible_rooms(self, request: str) -> Sequence[str]:
        """Return all rooms that a request may refer to."""
        return self.room_map.possible_rooms(request)

    @property
    def _around(self) -> str:
        """The room in which the robot is, also if it is at a place. People at a place are in its room."""
        return self._room_around(self.room)

    @property
    def here(self) -> ExploredRoom:
        """The facts about the robot's current room that the program knows."""
        return self.explored[self.room]

    def search(self, name: str) -> RoomSearch:
        """Return the rooms searched for a name. Searches for "red mug" count for "mug", and vice versa."""
        combined = RoomSearch()
        for sought, search in self.searches.items():
            is_part = contains(name, sought) or contains(sought, name)
            if sought == name or (is_part and SOMEBODY not in {sought, name}):
                combined.rooms_without |= search.rooms_without
                combined.rooms_with |= search.rooms_with
        return combined

    @contextmanager
    def excuse_errors(self, *, is_excusable: bool) -> Iterator[None]:
        """Add a RobotError in this context to `excuses` if it is excusable and the world is not strict."""
        try:
            yield
        except RobotError as error:
            if is_excusable and not self.sampler.strict:
                self.excuses.add(str(error))
            raise

    def _recall(self, event: Event) -> None:
        """Let the world be as the robot left or saw it in an event before the program began."""
        room, name = self.room_map.room(event.place), normalized(event.text)
        if event.failed:
            if room is not None and event.failed == NO_SUCH_THING:
                self.room = room
                self._see(name, is_person=False, is_there=False)
            return
        if room is None:
            if event.kind in {PICK, PLACE}:
                self._hold(event.text if event.kind == PICK else None)
            return
        self.room = room
        if event.kind == CHECK and event.found is not None:
            self._see(name, is_person=means_person(event.text), is_there=event.found)
        elif event.kind == ASK and event.answer is not None:
            who = normalized(event.to or "")
            self._see(who, is_person=True, is_there=True)
            self.answers[room, who, event.text.strip()] = event.answer
        elif event.kind == PICK:
            self._see(name, is_person=False, is_there=True)
            self._hold(event.text, next((one for one in self.things_here if _is(one, name)), None))
            for goal in self._reach.get(room, (room,)):
                self.contents[goal] = [one for one in self.contents[goal] if one is not self.taken]
            self.here.gone.add(name)
        elif event.kind == PLACE:
            self.contents[room].append(self.taken or Thing(name, is_pattern=False))
            self._hold(None)
            self.here.missed.discard(name)
            self.here.gone.discard(name)

    def _hold(self, held: str | None, taken: Thing | None = None) -> None:
        self.held = held
        self.taken = None if held is None else taken or Thing(normalized(held), is_pattern=False)

    def _see(self, name: str, *, is_person: bool, is_there: bool) -> None:
        """Let a thing or person be in this room, or not, as the robot saw it last."""
        is_person = is_person or name == SOMEBODY
        goal = self._around if is_person else self.room
        explored, search = self.explored[goal], self.searches[name]
        (search.rooms_with if is_there else search.rooms_without).add(self.room)
        if not is_there:
            explored.people -= explored.people if name == SOMEBODY else {name}
            for place in self._reach.get(self.room, (self.room,)):
                self.contents[place] = [one for one in self.contents[place] if one.label != name]
            explored.missed.add(name)
            return
        explored.missed -= {name, *([SOMEBODY] if is_person else [])}
        explored.gone.discard(name)
        if is_person:
            explored.people |= {name, SOMEBODY}
        elif not any(_is(one, name) for one in self.things_here):
            self._add(name, goal)

    def is_here(self, name: str) -> bool | None:
        """Return whether a person or thing is in this room, or None if that is not decided yet."""
        things, around = self.things_here if name != SOMEBODY else [], self.explored[self._around]
        if name in self.here.missed and not any(thing.label == name for thing in things):
            return False
        if name in around.people or any(_is(thing, name) for thing in things):
            return True
        is_missed = self.here.lacks(name) or around.lacks(name)
        return False if is_missed else None

    def settle(self, name: str, room: str, *, is_random: bool) -> bool:
        """Decide, record and return whether a person or thing is in a room (True unless `is_random`)."""
        is_there = not is_random or bool(self._draw("is_there", room, name))
        self.has_assumed |= not is_random
        self.facts.append(whereabouts(name, room, self.since, is_there=is_there, is_random=is_random))
        if not is_there:
            self.explored[room].missed.add(name)
        return is_there

    def _draw(self, method: DrawMethod, *arguments: str | int) -> int:
        self.draws.append(self.sampler.decide(method, *arguments))
        return self.draws[-1].result

    def answer(self, options: Sequence[str], *question: str) -> str:
        """Choose a random option to answer a question. `question` consists of its room, person and text."""
        if self.sampler.by_options:
            given = {option.strip().casefold(): option for option in options}
            options, name = [given[text] for text in sorted(given)], (question[0], *sorted(given))
            if question not in self.questions[name]:
                self.questions[name].append(question)
            question = (*name, str(self.questions[name].index(question)))
        agreeing = next((i for i, text in enumerate(options) if AGREEING_TEXT.match(text)), 0)
        return options[self._draw("answer", len(options), agreeing, *question)]

    def draw_outcome(self, statement: str, outcomes: Sequence[str], errors: Sequence[str] = ()) -> int:
        """Choose an outcome or error of a statement at random, once per run. Return its index."""
        possible = [*outcomes, *errors]
        if statement not in self.outcomes:
            drawn = self.outcomes[statement] = self._draw("outcome", len(possible), statement)
            self.facts.append(SampledFact("{} {}", (statement, possible[drawn])))
        return self.outcomes[statement]

    def sleep_until(self, now: float) -> None:
        """Let time pass. What an earlier mission saw of people, missed, or was answered may change."""
        super().sleep_until(now)
        self.answers = {} if self.recalled else self.answers  # those of this program are drawn alike again
        self.since = "after the first wait, " if self.recalled else self.since
        for room, (people, missed) in self.recalled.items():
            self.explored[room].people -= people
            self.explored[room].missed -= missed
        self.recalled = {}

    def known_names(self, sort: Literal["room", "thing", "person"]) -> Sequence[str]:
        """Return the names of all rooms, or of the things or people that the room map lists."""
        return {"room": self.rooms, "thing": self.room_map.things, "person": self.room_map.people}[sort]

    def room_for(self, request: str) -> str | None:
        """Return the room that a request means, or None. A guessed map has a room for every request."""
        return self.room_map.room(request)

    def look(self, entity: str) -> bool:
        """Return whether an object or a person is in this room. The first look decides this at random."""
        name = normalized(entity)
        described = [] if self.is_here(name) is not None else self._described(entity)
        names = [*map(normalized, described)] or [name]  # each of them is there or not
        found = any(self._find(one, is_person=means_person(entity)) for one in names)
        search = self.searches[name]
        (search.rooms_with if found else search.rooms_without).add(self.room)
        self.record(CHECK, entity, found=found)
        return found

    def _find(self, name: str, *, is_person: bool) -> bool:
        """Return whether a thing or person is in this room. The first time, this is decided at random."""
        is_person = is_person or name == SOMEBODY
        goal = self._around if is_person else self.room
        room, found = self.explored[goal], self.is_here(name)
        if found is None and (name in room.gone or (is_person and room.lacks(SOMEBODY))):
            found = False
            room.missed.add(name)
        if found is None:
            found = self.settle(name, goal, is_random=True)
            if found and is_person:
                room.people |= {name, SOMEBODY}
            if found and name != SOMEBODY:
                self._add(name, goal)
        return found

    def _add(self, name: str, goal: str) -> None:
        known = (one for one in (*self.room_map.things, *self.room_map.people) if normalized(one) == name)
        traits = self._trait_words.get(next(known, ""), NO_WORDS)
        self.contents[goal].append(Thing(name, is_pattern=False, traits=traits))

    def _described(self, entity: str) -> list[str]:
        """Return the known things or people that a request describes without naming them."""
        is_person = means_person(entity)
        known = self.room_map.people if is_person else self.room_map.things
        fitting = self._fitting(known, entity, WORDS_FOR_PEOPLE if is_person else ())
        return [] if means_anybody(entity) or meant_by(entity, known, plain=True) else fitting

    def things(self, where: str = "", is_: str = "") -> list[str]:
        """Return the things in the room `where` (default: anywhere) that fit `is_`, at random."""
        return self._all_of(self.room_map.things, where, is_ or "thing", is_person=False)

    def people(self, where: str = "", is_: str = "", **traits: object) -> list[str]:
        """Return people in the room `where` (default: anywhere) who fit `is_` and all `traits`, at random."""
        wanted = " ".join(str(one) for one in (is_, *traits.values()) if one) or SOMEBODY
        return self._all_of(self.room_map.people, where, wanted, is_person=True)

    def _all_of(self, known: Sequence[str], where: str, wanted: str, *, is_person: bool) -> list[str]:
        fitting = self._fitting(known, wanted, WORDS_FOR_PEOPLE if is_person else WORDS_FOR_THINGS)
        names = {normalized(name): name for name in fitting or [wanted]}
        goals: Sequence[str] = self._goals_in(where)
        if is_person:
            goals = [self._room_around(self.goal_of(where))] if where else self.rooms
        before, described = self.room, normalized(wanted)
        found = []
        for self.room in goals:
            is_known = described in self.here.missed  # an earlier look for this description found nothing
            finds = self.is_here if is_known else partial(self._find, is_person=is_person)
            there = [names[name] for name in names if finds(name)]
            if there and not fitting and self._has_another(described, is_person=is_person):
                there.append(f"another {wanted}")
            if not there and not self.is_here(described):
                self.here.missed.add(described)
            found += there or ([described] if self.is_here(described) else [])
        self.room = before
        return found

    def _has_another(self, name: str, *, is_person: bool) -> bool:
        """Return whether a second unknown person or thing like one in this room is there as well."""
        another, here = f"another {name}", self.here
        if another in here.missed:
            return False
        if another in here.people or any(thing.label == another for thing in self.contents[self.room]):
            return True
        is_there = self.settle(another, self.room, is_random=True)
        if is_there and is_person:
            here.people.add(another)
        elif is_there:
            self._add(another, self.room)
        return is_there

    def _fitting(self, known: Sequence[str], wanted: str, words: Sequence[str]) -> list[str]:
        """Return the known names that fit a description."""
        entities = (Entity(name, self._trait_words.get(name, NO_WORDS)) for name in known)
        return [entity.label for entity in entities if best_fits(wanted, [entity], words)]

    def move_person(self, name: str, room: str) -> None:
        """Move a person to a room or, given a place, to its room, and out of every other room."""
        goal, who = self._room_around(self.goal_of(room)), normalized(name)
        for place, explored in self.explored.items():
            things = self.contents[place]
            if who in explored.people or any(thing.label == who for thing in things):
                explored.missed.add(who)
            explored.people.discard(who)
            things[:] = [thing for thing in things if thing.label != who]
        self.explored[goal].missed -= {who, SOMEBODY}
        self.explored[goal].people |= {who, SOMEBODY}

    def ask(self, person: str, question: str, options: Sequence[object]) -> int:
        """Return a random option's index. A person never looked for is here (random in strict worlds)."""
        person, options = as_text(person), to_options(options)
        who = normalized(person)
        if not options or not self._answers(who):
            lost = self.search(who).is_lost or self.search(SOMEBODY).is_lost
            with self.excuse_errors(is_excusable=bool(options) and lost):
                return super().ask(person, question, options)
        self.record(ASK, question, options, to=person)
        asked = (self.room, who, question.strip())
        texts = [option.text for option in options]
        if self.answers.get(asked) not in texts:
            self.answers[asked] = self.answer(texts, *asked)
            self.facts.append(SampledFact(ANSWER_FORM, (self.room, question, self.answers[asked])))
        self.amend(self.answers[asked])
        return texts.index(self.answers[asked])

    @property
    def may_others_be_here(self) -> bool:  # noqa: D102 - inherited
        return SOMEBODY not in self.explored[self._around].missed

    def _answers(self, who: str) -> bool:
        is_there, around = self.is_here(who), self.explored[self._around]
        if is_there is None and around.lacks(SOMEBODY):
            is_there = False
        if is_there is None:
            is_random = self.sampler.strict or self.sampler.draws_people
            is_there = self.settle(who, self._around, is_random=is_random)
        if is_there:
            around.people |= {who, SOMEBODY}
        return is_there

    def take(self, obj: str) -> None:
        """Pick up an object. If the program never looked for it, it is here (random in strict worlds)."""
        name = normalized(obj)
        if self.held is None and self.is_here(name) is None and self._lies_there(name):
            self._add(name, self.room)
        search = self.search(name)
        again = self.held is not None and normalized(self.held) == name and len(search.rooms_with) > 1
        with self.excuse_errors(is_excusable=again or search.is_lost):
            super().take(obj)
        for goal in self._reach.get(self.room, (self.room,)):
            self.explored[goal].gone.add(name)
        self.here.people.discard(name)

    def _lies_there(self, name: str) -> bool:
        if name in self.here.gone:  # there may have been several of the same kind
            return not self.sampler.strict and self.settle(f"another {name}", self.room, is_random=False)
        return self.settle(name, self.room, is_random=self.sampler.strict)

    def put(self, obj: str) -> None:
        """Put down the held object. Excuse a failure if a search for the object found it nowhere."""
        with self.excuse_errors(is_excusable=self.held is None and self.search(normalized(obj)).is_lost):
            super().put(obj)


def _is(thing: Thing, name: str) -> bool:
    return thing.is_meant_by(name, "longest-name")
