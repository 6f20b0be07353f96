"""The places of a robot, read from a plain file or, by a mapping of a few lines, from any other."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict

from codebotler.core.words import brief
from codebotler.core.world import Point, Room, World, is_within
from codebotler.core.world_file import Corner, Metres, Name, YamlValue
from codebotler.core.yaml_files import YamlFile

EACH = "*"  # in a path: every entry
SIZES = (2, 3, 7)  # of points, of poses with a yaw, and of poses with a quaternion

Steps: TypeAlias = tuple[str | int, ...]
Match: TypeAlias = tuple[Steps, Steps, Any]


@dataclass(frozen=True)
class Place:
    """Somewhere the robot can drive to."""

    name: str  # unique, whatever its capitals
    x: float  # metres, where the robot stops
    y: float
    yaw: float = 0.0  # radians, counterclockwise from the x axis
    polygon: tuple[Point, ...] | None = None  # at least three corners in metres; None if they are unknown


@dataclass(frozen=True)
class Places:
    """All places of a robot, at least one, and the coordinate frame they are in, such as `map`."""

    frame: str
    places: tuple[Place, ...]

    def world(self, robot: str = "") -> World:
        """A world for maps, with the robot in a room."""
        rooms = (Room(one.name, footprint=one.polygon, stand_at=(one.x, one.y)) for one in self.places)
        return World(tuple(rooms), robot)

    def room_at(self, x: float, y: float) -> Place | None:
        """The place with the smallest polygon that holds a point, in metres."""
        around = (one for one in self.places if one.polygon and is_within((x, y), one.polygon))
        return min(around, key=lambda one: _area(one.polygon or ()), default=None)

    def nearest(self, x: float, y: float) -> Place:
        """The place where the robot stops nearest to a point, in metres."""
        return min(self.places, key=lambda one: math.dist((one.x, one.y), (x, y)))

    def named(self, text: str) -> Place | None:
        """The place with a name, whatever its capitals and the blanks around it."""
        return next((one for one in self.places if one.name.casefold() == text.strip().casefold()), None)


def _area(corners: Sequence[Point]) -> float:
    edges = zip(corners, [*corners[1:], *corners[:1]], strict=True)
    return abs(sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in edges)) / 2


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, coerce_numbers_to_str=True)


class PlacesFile(_Form):
    """A plain file of places."""

    frame: Name = "map"
    places: dict[Name, dict[Literal["x", "y", "yaw", "polygon"], Any]]


class PlacesMapping(_Form):
    """How to read the places in a file, by paths of keys and positions with dots between them."""

    file: Name
    frame: Name = "map"
    each: str = "places.*"
    where: dict[str, YamlValue] = {}
    name: str = ""
    pose: str | list[str] = ""
    polygon: str = "polygon"
    yaw: Literal["radians", "degrees"] = "radians"
    resolution: Metres | None = None  # metres a pixel of an image, if places are pixels from its top left
    origin: Corner | tuple[Metres, Metres, Metres] = (0.0, 0.0)  # its lower left corner in metres
    height: Metres = 0.0  # in pixels
    skip: list[str] = []


def read_places(source: object, at: YamlFile) -> Places:
    """Read the places of a robot.

    Args:
        source: the name of a plain file, a mapping for any other, or a list of these.
        at: the file that has this under `places`; other files are named from its folder.

    Raises:
        UserError: something is wrong; it names the line, and how to mend it.
    """
    found: dict[str, Place] = {}
    frames: list[str] = []
    for number, one in enumerate(source if isinstance(source, list) and source else [source]):
        here = ("places", number) if isinstance(source, list) else ("places",)
        mapping = at.validate(PlacesMapping, {"file": one} if isinstance(one, str) else one, at=here)
        file = YamlFile.read(Path(at.name).parent / mapping.file)
        frames.append(file.validate(PlacesFile).frame if isinstance(one, str) else mapping.frame)
        if frames[-1] != frames[0]:
            raise at.wrong(f'these places are in "{frames[-1]}", others in "{frames[0]}"; use one', *here)
        entries = [*_named(mapping, file.data)]
        if not entries:
            sentence = f'"{mapping.each}" leads to no place with a name in {file.name}'
            raise at.wrong(f'{sentence}; correct "each" or "name"', *here, "each")
        for name, where, entry in entries:
            try:
                found[name.casefold()] = _place(name, entry, mapping, found)
            except ValueError as error:
                mend = f'correct it, or leave it out by "skip: [{name}]"'
                raise file.wrong(f'the place "{name}" cannot be read: {error}; {mend}', *where) from None
    return Places(frames[0], tuple(found.values()))


def _matches(data: object, path: str, at: Steps = (), stars: Steps = ()) -> Iterator[Match]:
    """All that a path leads to: where it is, the keys that stars of the path stand for, and the value."""
    step, _, rest = path.partition(".")
    if not step:
        yield at, stars, data
        return
    entries = enumerate(data) if isinstance(data, list) else data.items() if isinstance(data, dict) else ()
    for key, value in entries:
        if step in {EACH, str(key)}:
            is_key = step == EACH and isinstance(data, dict)
            yield from _matches(value, rest, (*at, key), (*stars, key) if is_key else stars)


def _found(data: object, path: str) -> Any:  # noqa: ANN401 - of any file
    return next((value for _, _, value in _matches(data, path)), None)


def _named(mapping: PlacesMapping, data: object) -> Iterator[tuple[str, Steps, Any]]:
    """The entries that are meant and have a name: the name, where the entry is, and the entry."""
    for where, stars, entry in _matches(data, mapping.each):
        name = mapping.name or " ".join(EACH for _ in stars)
        if EACH not in name:
            value = _found(entry, name)
            name = str(value).strip() if isinstance(value, str | int) else ""
        for star in stars:
            name = name.replace(EACH, str(star).strip(), 1)
        is_meant = all(_found(entry, path) == value for path, value in mapping.where.items())
        if name and name not in mapping.skip and is_meant:
            yield name, where, entry


def _place(name: str, entry: object, mapping: PlacesMapping, others: Mapping[str, Place]) -> Place:
    """The place in an entry; a ValueError says what is wrong with it."""
    if other := others.get(name.casefold()):
        raise ValueError(f'another one is called "{other.name}", and capitals make no difference')
    corners, paths, size = _found(entry, mapping.polygon), mapping.pose, mapping.resolution
    polygon = [(x, y) for x, y, *_ in map(_numbers, corners)] if isinstance(corners, list) else []
    if corners is not None and not polygon[2:]:
        raise ValueError("its polygon has less than three corners")
    pose = _found(entry, paths) if isinstance(paths, str) else [_found(entry, path) for path in paths]
    if polygon and (pose is None or (pose is entry and _found(entry, "x") is None)):
        pose = [sum(parts) / len(polygon) for parts in zip(*polygon, strict=True)]
        if not is_within((pose[0], pose[1]), polygon):
            raise ValueError("it has no x and y, and the middle of its polygon is outside")
    x, y, *turn = _numbers(pose)
    points = [(x, y), *polygon]
    if size is not None:
        (left, low, *_), high = mapping.origin, mapping.height
        points = [(left + size * x, low + size * (high - y)) for x, y in points]
    yaw = [*turn, 0.0][0] * (math.pi / 180 if mapping.yaw == "degrees" else 1)
    if turn[1:]:
        _, x, y, z, w = turn
        yaw = math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return Place(name, *points[0], yaw, tuple(points[1:]) or None)


def _numbers(value: Any) -> list[float]:  # noqa: ANN401 - of any file
    """The x and y of a corner or a pose, and its yaw, or its z and quaternion, if it has them."""
    match value:
        case {"position": point, "orientation": {"x": x, "y": y, "z": z, "w": w}}:
            value = [*_numbers(point)[:2], 0.0, x, y, z, w]
        case {"x": x, "y": y, **more}:
            value = [x, y, more.get("yaw", 0.0)]
    with suppress(TypeError, ValueError, OverflowError):
        numbers = [float(one) for one in value] if isinstance(value, list) else []
        if len(numbers) in SIZES and all(map(math.isfinite, numbers)):
            return numbers
    raise ValueError(f"{brief(str(value))} is no point or pose of finite numbers")
