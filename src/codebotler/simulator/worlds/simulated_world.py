"""The state of a simulated world, and what requests mean in it."""

from __future__ import annotations

import json
from _blake2 import blake2b  # `hashlib` would load OpenSSL into every child
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.values import Scalar
from codebotler.core.text.labels import plain_names
from codebotler.core.text.words import listed
from codebotler.core.world import World
from codebotler.simulator.settings import SimulationSettings
from codebotler.simulator.worlds.entities import NO_WORDS, Somebody, Thing
from codebotler.simulator.worlds.fact_sampler import FactSampler
from codebotler.simulator.worlds.matching import (
    WORDS_FOR_PEOPLE,
    WORDS_FOR_THINGS,
    best_fits,
    finds,
    goals_meant,
    resolve_room,
    trait_words,
)

NO_SUCH_THING = "PickInvalidObject"
"""The kind of error when a robot tries to pick up a thing that is not there."""


class SimulatedWorld:
    """A copy of a world that changes while a robot acts in it.

    Args:
        world: its initial state.
        settings: how requests refer to its rooms, things and people.

    Attributes:
        rooms: the names of the rooms.
        goals: the names of the rooms and of the places in them, to which the robot can drive.
        room: the room or place where the robot is.
    """

    def __init__(self, world: World, settings: SimulationSettings) -> None:
        self.world, self.settings = world, settings
        self.rooms = tuple(room.name for room in world.rooms if not room.within)
        self.goals = tuple(room.name for room in world.rooms)
        self.room = world.robot
        self.full_names = {room.name: room.full_name for room in world.rooms if room.within}

    @property
    def place(self) -> str:
        """Where the robot is, as in traces: "hall" for a room, "desk in office" for a place."""
        return self.full_names.get(self.room, self.room)

    @cached_property
    def contents(self) -> dict[str, list[Thing]]:
        """The objects in each room and place, by the name of the room or place."""
        rooms, words = self.world.rooms, self._trait_words
        return {
            room.name: [Thing(one, traits=words.get(one, NO_WORDS)) for one in room.objects] for room in rooms
        }

    @cached_property
    def _trait_words(self) -> Mapping[str, frozenset[str]]:
        return {name: trait_words(traits) for name, traits in self.world.traits}

    @cached_property
    def occupants(self) -> dict[str, list[Somebody]]:
        """The people in each room and place, by the name of the place, including people who arrive later."""
        rooms, words = self.world.rooms, self._trait_words
        return {r.name: [Somebody(one, words.get(one.name, NO_WORDS)) for one in r.people] for r in rooms}

    @cached_property
    def _reach(self) -> Mapping[str, tuple[str, ...]]:
        """For each room or place, the places in it, and itself."""
        places = [(room.within, room.name) for room in self.world.rooms if room.within]
        return {goal: (goal, *(place for room, place in places if room == goal)) for goal in self.goals}

    @property
    def things_here(self) -> list[Thing]:
        """The things in the robot's room and at the places in it, or only at the place where the robot is."""
        if len(self.rooms) == len(self.goals):
            return self.contents[self.room]
        goals = self._reach.get(self.room, (self.room,))  # on a guessed map, there are more rooms
        return [thing for goal in goals for thing in self.contents[goal]]

    @property
    def people_here(self) -> list[Somebody]:
        """The people in the robot's room, including people who arrive later."""
        if len(self.rooms) == len(self.goals):
            return self.occupants[self.room]
        return [one for goal in self._reach[self._room_around(self.room)] for one in self.occupants[goal]]

    def _room_around(self, goal: str) -> str:
        """Return the room in which a place is, or the room itself."""
        if not self.full_names:
            return goal
        return next((room.within for room in self.world.rooms if room.name == goal), "") or goal

    def possible_rooms(self, request: str) -> Sequence[str]:
        """Return all rooms that a request may mean. Labels are regexes, so even an exact name may fit two."""
        if self.settings.matching == "longest-name":
            around = {room.name: room.within for room in self.world.rooms if room.within}
            return goals_meant(request, self.goals, around)
        wanted = request.strip().lower()
        named = [room for room in self.goals if room.lower() == wanted]
        if named:
            leads_to = resolve_room(self.goals, request, self.settings.matching)
            return [*named, *([] if leads_to is None else [leads_to])]
        return [room for room in self.goals if finds(request, room, self.settings.matching)]

    def room_for(self, request: str) -> str | None:
        """Return the room that a request means, or None if it means none or could mean several."""
        if self.settings.matching == "longest-name":
            possible = self.possible_rooms(request)
            return possible[0] if len(possible) == 1 else None
        return resolve_room(self.goals, request, self.settings.matching)

    def thing_meant(self, request: str) -> Thing | None:
        """Return the object here that a request means, or None. Raise RobotError if it may mean several."""
        matching, here = self.settings.matching, self.things_here
        if matching != "longest-name":
            return next((thing for thing in here if thing.is_meant_by(request, matching)), None)
        best = [here[number] for number in best_fits(request, [thing.entity for thing in here])]
        if len(best) > 1:
            raise RobotError(NO_SUCH_THING, ambiguous(request, [thing.label for thing in best]))
        return best[0] if best else None

    def person_meant(self, request: str) -> Somebody | None:
        """Return the person here whom a request means, or None. Raise RobotError if it may mean several."""
        settings, here = self.settings, [one for one in self.people_here if one.is_here]
        if settings.matching != "longest-name" or not request.strip():
            return next((one for one in here if one.is_meant_by(request, settings)), None)
        best = [here[n] for n in best_fits(request, [one.entity for one in here], settings.words_for_people)]
        if len(best) > 1:
            raise RobotError("AskNoPerson", ambiguous(request, [one.person.name for one in best]))
        return best[0] if best else None

    @cached_property
    def _truths(self) -> Mapping[str, Scalar | tuple[Scalar, ...]]:
        return {statement.casefold(): value for statement, value in self.world.truths}

    def things(self, where: str = "", is_: str = "") -> list[str]:
        """Return names of things in the room `where` (default: anywhere) that fit the description `is_`."""
        found = [thing for goal in self._goals_in(where) for thing in self.contents[goal]]
        fitting = (one for one in found if not is_ or best_fits(is_, [one.entity], WORDS_FOR_THINGS))
        return [thing.label for thing in fitting]

    def people(self, where: str = "", is_: str = "", **traits: object) -> list[str]:
        """Return names of people in the room `where` (default: anywhere) who fit `is_` and all `traits`."""
        around = self._room_around(self.goal_of(where)) if where else ""
        found = [one for goal in self._goals_in(around) for one in self.occupants[goal] if one.is_here]
        wanted = [str(one) for one in (is_, *traits.values()) if one]
        words = self.settings.words_for_people or WORDS_FOR_PEOPLE
        return [o.person.name for o in found if all(best_fits(text, [o.entity], words) for text in wanted)]

    def _goals_in(self, where: str) -> Sequence[str]:
        """Return a room and the places in it, or all of them if no room is given."""
        if not where:
            return self.goals
        goal = self.goal_of(where)
        return self._reach.get(goal, (goal,))  # on a guessed map, there are more rooms

    def goal_of(self, request: str) -> str:
        """Return the room or place that a request means. Raise RobotError if it is unknown or ambiguous."""
        room = self.room_for(request)
        if room is None:
            raise unknown_room(request, self.possible_rooms(request))
        return room

    def traits(self, name: str) -> Mapping[str, Scalar | tuple[str, ...]]:
        """Return the properties that the world gives to a thing or person, such as `{"color": "red"}`."""
        return dict(dict(self.world.traits).get(name, ()))

    def move_person(self, name: str, room: str) -> None:
        """Move the person who fits `name` to a room or place. Raise RobotError unless exactly one fits."""
        goal = self.goal_of(room)
        everybody = [one for goal in self.goals for one in self.occupants[goal] if one.is_here]
        words = self.settings.words_for_people or WORDS_FOR_PEOPLE
        meant = best_fits(name, [one.entity for one in everybody], words)
        if len(meant) != 1:
            raise RobotError("AskNoPerson", f'"{name}" cannot be moved; use a name that fits one person')
        for here in self.occupants.values():
            here[:] = [one for one in here if one is not everybody[meant[0]]]
        self.occupants[goal].append(everybody[meant[0]])

    def value(self, statement: str, *values: Scalar) -> Any:  # noqa: ANN401 - any type
        """Return the value that this world sets for a statement, or else a random one of `values`."""
        known = self._truths.get(statement.casefold())
        if known is not None:
            return known
        return values[self.draw_outcome(f'"{statement}"', [f"is {value}" for value in values])]

    def truth(self, statement: str) -> bool:
        """Return whether a statement is true in this world; at random if the world does not set it."""
        known = self._truths.get(statement.casefold())
        if known is None:
            return self.draw_outcome(f'"{statement}"', ("is true", "is not true")) == 0
        if not isinstance(known, bool):
            raise UserError(f'the world sets "{statement}" to {known!r}; use true or false')
        return known

    def known_names(self, sort: Literal["room", "thing", "person"]) -> Sequence[str]:
        """Return the names of all rooms, or of the things or people whose name is not a regex."""
        if sort == "room":
            return self.rooms
        if sort == "thing":
            labels = [thing.label for here in self.contents.values() for thing in here]
        else:
            labels = [one.person.name for here in self.occupants.values() for one in here]
        return plain_names(labels)

    def draw_outcome(self, statement: str, outcomes: Sequence[str], _errors: Sequence[str] = ()) -> int:
        """Choose an outcome of a statement at random, always the same in one world. Return its index."""
        return self._sampler.draw(len(outcomes), statement)

    @cached_property
    def _sampler(self) -> FactSampler:
        world = json.dumps(self.world.to_data(), sort_keys=True)
        return FactSampler(int.from_bytes(blake2b(world.encode(), digest_size=8).digest(), "big"))


def unknown_room(location: str, possible: Sequence[str] = ()) -> RobotError:
    """Return the error for a drive to an unknown room, or to one of several possible rooms."""
    sentence = ambiguous(location, possible) if len(possible) > 1 else f'there is no room "{location}"'
    return RobotError("GoToInvalidLocation", sentence)


def ambiguous(request: str, names: Sequence[str]) -> str:
    """Return the message `"lab" could mean "lab 1" or "lab 2"; use the name of one of them`."""
    quoted = [f'"{name}"' for name in names]
    return f'"{request}" could mean {listed(quoted, "or")}; use the name of one of them'
