"""Worlds: rooms, objects, people with scripted answers, and the robot's start."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from typing import TypeAlias

from codebotler.core.skills.values import Scalar
from codebotler.core.text.unicode import compose_fields
from codebotler.core.text.words import counted

warnings.filterwarnings("ignore", "Possible (nested )?set", FutureWarning)  # such regexes still work

Point: TypeAlias = tuple[float, float]

Trait: TypeAlias = tuple[str, Scalar | tuple[str, ...]]
"""A property of a thing or person, such as `("wears", "red coat")` or `("is", ("fruit", "red"))`."""

Answer: TypeAlias = str | int
"""A regex for the chosen option, or its position: 1 is the first, -1 the last."""


@dataclass(frozen=True)
class Person:
    """A person in a room, with scripted answers to the robot's questions."""

    name: str  # a regex that matches their names
    answers: tuple[Answer, ...] = ()  # one per question; the last one repeats; if empty, questions fail
    topics: tuple[tuple[str, Answer], ...] = ()  # regexes for questions, each with its own answer
    after_looks: int = 0  # the number of unsuccessful looks before they arrive
    leaves: bool = False  # whether they leave after their last answer

    def __post_init__(self) -> None:
        compose_fields(self)


@dataclass(frozen=True)
class Room:
    """A room that the robot can drive to.

    Args:
        name: the name, or a regex that is searched for in a program's requests.
        objects: the labels of its objects, in order.
        people: the people in it, in order.
        footprint: the positions of its corners in metres; None if unknown.
        stand_at: the point where the robot stops, in metres; None if unknown.
        within: the room that contains it if it is a place inside a room, such as a table, else empty.
    """

    name: str
    objects: tuple[str, ...] = ()
    people: tuple[Person, ...] = ()
    footprint: tuple[Point, ...] | None = None
    stand_at: Point | None = None
    within: str = ""

    def __post_init__(self) -> None:
        compose_fields(self)

    @property
    def full_name(self) -> str:
        """The name in traces and for rules, such as `sink in kitchen` for a place in a room."""
        return f"{self.name} in {self.within}" if self.within else self.name


@dataclass(frozen=True)
class World:
    """The initial state of a simulated world (paper, section IV.A).

    Args:
        rooms: the rooms, at least one, with unique names, in the order in which the robot lists them.
        robot: the room where the robot starts.
        about: a short description.
        may_wait_forever: whether a program may wait in this world for something that never happens.
        truths: statements and calls of custom skills with their values: `('read_gauge("boiler")', 3)`.
        traits: the properties of things and people, such as `("apple", (("kind", "fruit"),))`.
    """

    rooms: tuple[Room, ...]
    robot: str
    about: str = ""
    may_wait_forever: bool = False
    truths: tuple[tuple[str, Scalar | tuple[Scalar, ...]], ...] = ()
    traits: tuple[tuple[str, tuple[Trait, ...]], ...] = ()

    def __post_init__(self) -> None:
        compose_fields(self)

    @property
    def descriptions(self) -> list[str]:
        """The texts in the properties of its things and people, such as `fruit` or `red coat`."""
        values = [value for _, traits in self.traits for _, value in traits]
        lists = [one if isinstance(one, tuple) else (one,) for one in values]
        return [text for texts in lists for text in texts if isinstance(text, str)]

    def __repr__(self) -> str:
        return f"World({counted(len(self.rooms), 'room')}, robot={self.robot!r})"

    def to_yaml(self) -> str:
        """Return this world as the text of a world file."""
        import yaml

        return yaml.safe_dump(self.to_data(), sort_keys=False, allow_unicode=True, width=100)

    def to_data(self) -> dict[str, object]:
        """Return this world as dictionaries and lists, with the keys of a world file."""
        traits = {name: {key: _as_lists(value) for key, value in of} for name, of in self.traits}
        rooms = self.rooms
        places = {room.name: [_room_data(one) for one in rooms if one.within == room.name] for room in rooms}
        data = {
            "about": self.about,
            "robot": self.robot,
            "rooms": [_room_data(room, places[room.name]) for room in rooms if not room.within],
            "objects": {r.name: [_thing_data(one, traits) for one in r.objects] for r in rooms if r.objects},
            "people": {r.name: [_person_data(one, traits) for one in r.people] for r in rooms if r.people},
            "may_wait_forever": self.may_wait_forever,
            "truths": {key: _as_lists(value) for key, value in self.truths},
        }
        return {key: value for key, value in data.items() if value or key == "about"}


ROOM_WIDTH, ROOM_DEPTH, HALLWAY = 4.0, 3.0, 2.0
SQUARE = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))


def _squared(room: Room) -> Room:
    if room.footprint is not None or room.stand_at is None:
        return room
    x, y = room.stand_at
    return replace(room, footprint=tuple((x + dx, y + dy) for dx, dy in SQUARE))


def laid_out(world: World) -> World:
    """Return a world in which every room has a footprint and a standing point, on both sides of a hallway.

    Existing footprints are kept. A room with only a standing point gets a square metre around that point.
    All other rooms are placed to the right.
    """
    known = [_squared(room) for room in world.rooms if not room.within]
    taken = [x for room in known for x, _ in room.footprint or ()]
    start = max(taken, default=0.0) + (HALLWAY if taken else 0.0)
    rooms, placed = [], 0
    for room in known:
        footprint = room.footprint
        if footprint is None:
            left = start + placed // 2 * ROOM_WIDTH
            low = 0.0 if placed % 2 == 0 else ROOM_DEPTH + HALLWAY
            right, high = left + ROOM_WIDTH, low + ROOM_DEPTH
            footprint = ((left, low), (right, low), (right, high), (left, high))
            placed += 1
        xs, ys = zip(*footprint, strict=True)
        centre = (sum(xs) / len(xs), sum(ys) / len(ys))
        rooms.append(replace(room, footprint=footprint, stand_at=room.stand_at or centre))
    return replace(world, rooms=tuple(chain.from_iterable(_with_places(room, world) for room in rooms)))


PLACE_WIDTH, PLACE_DEPTH = 0.88, 0.36  # of a place's share of the wall, and of the room's depth


def _with_places(room: Room, world: World) -> Iterator[Room]:
    """Yield a room and the places in it. Places without a position get one along the lower wall."""
    yield room
    places = [one for one in world.rooms if one.within == room.name]
    xs, ys = zip(*(room.footprint or SQUARE), strict=True)
    share, depth = (max(xs) - min(xs)) / (len(places) or 1), max(ys) - min(ys)
    dx, dy = PLACE_WIDTH * share / 2, PLACE_DEPTH * depth / 2
    for number, place in enumerate(places):
        x, y = place.stand_at or (min(xs) + (number + 0.5) * share, min(ys) + 1.15 * dy)
        corners = ((x - dx, y - dy), (x + dx, y - dy), (x + dx, y + dy), (x - dx, y + dy))
        yield replace(place, footprint=place.footprint or corners, stand_at=(x, y))


MIN_PART = 1e-9  # a fraction of an edge or a path, or metres; smaller values are rounding errors


def is_within(point: Point, corners: Sequence[Point]) -> bool:
    """Whether a point is in a polygon or on its edge."""
    (x, y), here, ends = point, complex(*point), [complex(*corner) for corner in corners]
    for start, end in zip(ends, [*ends[1:], ends[0]], strict=True):
        along = (here - start) / (end - start or MIN_PART)
        if abs(along.imag) <= MIN_PART and -MIN_PART <= along.real <= 1 + MIN_PART:
            return True
    return sum(x < crossing for crossing in crossings(y, corners)) % 2 == 1


def rooms_along(rooms: Iterable[Room], start: Point, end: Point) -> Iterator[tuple[str, ...]]:
    """Cut a straight path where it enters or leaves a room. For each part, yield the rooms it is in."""
    here, way = complex(*start), complex(*end) - complex(*start) or MIN_PART
    edges = {}  # for each room, the fractions of the path at which the path crosses its edges
    for room in rooms:
        corners = [(complex(*corner) - here) / way for corner in room.footprint or ()]
        edges[room.name] = crossings(0.0, [(corner.real, corner.imag) for corner in corners])
    cuts = {0.0, 1.0, *(edge for each in edges.values() for edge in each if 0 < edge < 1)}
    for one, other in pairwise(sorted(cuts)):
        if other - one > MIN_PART:
            middle = (one + other) / 2
            yield tuple(name for name, each in edges.items() if sum(edge > middle for edge in each) % 2)


def crossings(y: float, corners: Sequence[Point]) -> list[float]:
    """Return the x coordinates, sorted, at which the edges of a polygon cross the horizontal line at `y`."""
    edges = zip(corners, [*corners[1:], *corners[:1]], strict=True)
    return sorted(
        a + (y - low) / (high - low) * (b - a) for (a, low), (b, high) in edges if (low > y) != (high > y)
    )


def _as_lists(value: object) -> object:
    return [_as_lists(one) for one in value] if isinstance(value, tuple) else value


def _thing_data(label: str, traits: Mapping[str, dict[str, object]]) -> object:
    return {"name": label, **traits[label]} if label in traits else label


def _person_data(person: Person, traits: Mapping[str, dict[str, object]]) -> dict[str, object]:
    data: dict[str, object] = {
        **vars(person),
        **traits.get(person.name, {}),
        "answers": [*map(_answer_data, person.answers)],
        "topics": {topic: _answer_data(answer) for topic, answer in person.topics},
    }
    return {key: value for key, value in data.items() if value or key == "answers" or key not in vars(person)}


def _answer_data(answer: Answer) -> object:
    return {"option": answer} if isinstance(answer, int) else answer


def _room_data(room: Room, places: Sequence[object] = ()) -> object:
    more = {"footprint": _as_lists(room.footprint), "stand_at": _as_lists(room.stand_at), "places": [*places]}
    data = {key: value for key, value in more.items() if value}
    return {"name": room.name, **data} if data else room.name
