"""The map of a world's rooms, which is known before any random facts are chosen."""

from __future__ import annotations

from dataclasses import dataclass, replace

from codebotler.core.text.labels import plain_names
from codebotler.core.text.unicode import compose_fields
from codebotler.core.text.words import listed
from codebotler.core.trace import Trace
from codebotler.core.world import Room, Trait, World, laid_out
from codebotler.simulator.worlds.matching import goals_meant


@dataclass(frozen=True)
class RoomMap:
    """The known part of a world before random facts are chosen: rooms, names, properties, past events.

    Args:
        rooms: the names of the rooms, in the order in which the robot lists them.
        start: the room where the robot starts.
        guessed: whether the rooms are a guess; if so, any other place that a program names exists as well.
        plain: whether names are plain text and not regexes, as always on real robots.
        plan: the rooms with their footprints, and with stopping points if the robot drives straight.
        things: the names of known things, which may be anywhere.
        people: the names of known people, who may be anywhere.
        traits: the name and the properties of each thing or person that has properties.
        places: the name of each place in a room, and the name of the room.
        past: what the robot did and saw before the program begins.
    """

    rooms: tuple[str, ...]
    start: str
    guessed: bool = False
    plain: bool = False
    plan: tuple[Room, ...] = ()
    things: tuple[str, ...] = ()
    people: tuple[str, ...] = ()
    traits: tuple[tuple[str, tuple[Trait, ...]], ...] = ()
    places: tuple[tuple[str, str], ...] = ()
    past: Trace = ()

    def __post_init__(self) -> None:
        compose_fields(self)

    @classmethod
    def of(cls, world: World) -> RoomMap:
        """Return the map of a world. It lists the things and people, but not where they are."""
        plan = [replace(room, objects=(), people=()) for room in laid_out(world).rooms]
        return cls(
            tuple(room.name for room in world.rooms if not room.within),
            world.robot,
            plan=tuple(plan),
            places=tuple((room.name, room.within) for room in world.rooms if room.within),
            traits=world.traits,
            things=plain_names(label for room in world.rooms for label in room.objects),
            people=plain_names(person.name for room in world.rooms for person in room.people),
        )

    @classmethod
    def of_places(cls, world: World) -> RoomMap:
        """Return the map of a robot that plans its own routes and starts in the world's first room."""
        names = tuple(room.name for room in world.rooms)
        plan = tuple(Room(room.name, (), (), room.footprint) for room in world.rooms)
        return cls(names, names[0], plain=True, plan=plan)

    def room(self, request: str) -> str | None:
        """Return the room that a request means, or None if it means none or may mean several."""
        meant = self._meant(request)
        if not meant and self.guessed:
            return request.strip() or None
        return meant[0] if len(meant) == 1 else None

    def possible_rooms(self, request: str) -> list[str]:
        """Return all known rooms to which a drive with this request might lead, on any robot."""
        meant, wanted = self._meant(request), request.strip().casefold()
        if not self.plain or any(room.strip().casefold() == wanted for room in meant):
            return meant
        return [room for room in self.rooms if room.strip().casefold() in wanted]

    def _meant(self, request: str) -> list[str]:
        return goals_meant(request, self.goals, dict(self.places), plain=self.guessed or self.plain)

    def full_name(self, room: str) -> str:
        """Return a room's or place's name as used in rules, such as "hall" or "desk in office"."""
        within = dict(self.places).get(room)
        return f"{room} in {within}" if within else room

    @property
    def goals(self) -> tuple[str, ...]:
        """The rooms, and the places in them. The robot can drive to each of them."""
        return (*self.rooms, *(place for place, _ in self.places))

    @property
    def described(self) -> list[str]:
        """The rooms as described to a model, such as "office (with desk and shelf)"."""
        places = {room: [place for place, within in self.places if within == room] for room in self.rooms}
        return [f"{room} (with {listed(within)})" if within else room for room, within in places.items()]


NO_ROOMS = RoomMap((), "")
