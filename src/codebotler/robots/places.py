"""The places of a robot: read from a plain file or, by a mapping of a few lines, from a file of another shape."""

from __future__ import annotations

import cmath
import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from codebotler.core.errors import UserError
from codebotler.core.world import Point, Room, World, is_within
from codebotler.core.world_file import Corner, Metres, Name, Value
from codebotler.core.yaml_files import YamlFile

EACH, ITSELF = "*", "."  # in a path: each entry; a whole entry
HALF_SQUARE = 0.5  # metres
LEAST_CORNERS = 3

Location: TypeAlias = tuple[str | int, ...]


@dataclass(frozen=True)
class Place:
    """Somewhere the robot can drive to.

    Args:
        name: unique, whatever its capitals.
        x: where the robot stops, in metres.
        y: the same.
        yaw: where the robot looks then, in radians, counterclockwise from the x axis.
        polygon: its corners in metres, at least three; None if they are unknown.
    """

    name: str
    x: float
    y: float
    yaw: float = 0.0
    polygon: tuple[Point, ...] | None = None


@dataclass(frozen=True)
class Places:
    """All places of a robot.

    Args:
        frame: the coordinate frame that all are in, such as `map`.
        places: at least one, in the order of their files.
    """

    frame: str
    places: tuple[Place, ...]

    def world(self, robot: str = "") -> World:
        """A world for maps, where a place without a polygon is a square around its point.

        Args:
            robot: the place where the robot starts; empty if that is unknown.
        """
        rooms = (Room(one.name, footprint=_outline(one), stand_at=(one.x, one.y)) for one in self.places)
        return World(tuple(rooms), robot)

    def room_at(self, x: float, y: float) -> Place | None:
        """The place with the smallest polygon that holds a point, in metres."""
        around = [one for one in self.places if one.polygon and is_within((x, y), one.polygon)]
        return min(around, key=lambda one: _area(one.polygon or ()), default=None)

    def nearest(self, x: float, y: float) -> Place:
        """The place where the robot stops nearest to a point, in metres."""
        return min(self.places, key=lambda one: math.dist((one.x, one.y), (x, y)))

    def named(self, text: str) -> Place | None:
        """The place with a name, whatever its capitals and the blanks around it."""
        return next((one for one in self.places if _folded(one.name) == _folded(text)), None)


def _folded(name: str) -> str:
    return name.strip().casefold()


def _outline(place: Place) -> tuple[Point, ...]:
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    return place.polygon or tuple((place.x + a * HALF_SQUARE, place.y + b * HALF_SQUARE) for a, b in signs)


def _area(corners: Sequence[Point]) -> float:
    edges = zip(corners, [*corners[1:], *corners[:1]], strict=True)
    return abs(sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in edges)) / 2


# --- files


FieldPath = Annotated[Name, BeforeValidator(lambda path: str(path) if isinstance(path, int) else path)]


class _Form(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PlaceFile(_Form):
    """A place in a plain file."""

    x: Metres | None = None
    y: Metres | None = None
    yaw: Metres = 0.0
    polygon: Annotated[list[Corner], Field(min_length=3)] | None = None


class PlacesFile(_Form):
    """A plain file of places."""

    frame: Name = "map"
    places: Annotated[dict[Name, PlaceFile], Field(min_length=1)]


class PosePaths(_Form):
    """Where a pose is in an entry, and where its parts are if its shape is not a usual one."""

    at: FieldPath = ITSELF
    x: FieldPath | None = None
    y: FieldPath | None = None
    yaw: FieldPath | None = None

    @model_validator(mode="before")
    @classmethod
    def _path_alone(cls, data: object) -> object:
        return data if isinstance(data, dict | PosePaths) else {"at": data}


class PixelsForm(_Form):
    """How pixels become metres: numbers, or paths to numbers in the file of the places."""

    resolution: Any
    origin: Any = (0.0, 0.0)
    height: Any = 0.0


class PlacesMapping(_Form):
    """How to read places in a file of another shape."""

    file: Name
    each: FieldPath
    frame: Name = "map"
    where: dict[Name, Value] = {}
    name: FieldPath | None = None
    pose: PosePaths = PosePaths()
    polygon: FieldPath | None = None
    yaw: Literal["radians", "degrees"] = "radians"
    pixels: PixelsForm | None = None
    skip: list[Name] = []


def read_places(source: object, at: YamlFile) -> Places:
    """Read the places of a robot.

    Args:
        source: the name of a plain file, a mapping for another one, or a list of these.
        at: the file that has this under `places`; other files are named from its folder.

    Raises:
        UserError: something is wrong; it names the line, and how to mend it.
    """
    found: dict[str, Place] = {}
    frames: list[str] = []
    for number, one in enumerate(source if isinstance(source, list) else [source]):
        here = ("places", number) if isinstance(source, list) else ("places",)
        mapping = None if isinstance(one, str) else at.validate(PlacesMapping, one, at=here)
        file = YamlFile.read(Path(at.name).parent / (mapping.file if mapping else str(one)))
        mapping = mapping or _plain(file)
        frames.append(mapping.frame)
        if mapping.frame != frames[0]:
            raise at.wrong(f'these places are in "{mapping.frame}", others in "{frames[0]}"; use one', *here)
        count, to_metres = len(found), _to_metres(mapping.pixels, file)
        for name, where, entry in _named(mapping, file):
            try:
                _expect_new(name, found)
                found[_folded(name)] = _place(name, entry, mapping, to_metres)
            except ValueError as error:
                raise file.wrong(f'{error}, or leave it out by "skip: [{name}]"', *where) from None
        if len(found) == count:
            sentence = f'"{mapping.each}" leads to no place with a name in {file.name}'
            raise at.wrong(f'{sentence}; correct "each" or "name"', *here, "each")
    return Places(frames[0], tuple(found.values()))


def _plain(file: YamlFile) -> PlacesMapping:
    if not isinstance(file.data, dict) or "places" not in file.data:
        raise file.wrong('there is no key "places"; write it, or in place of the file a mapping with "each"')
    frame = file.validate(PlacesFile).frame
    return PlacesMapping(file=str(file.name), frame=frame, each="places.*", polygon="polygon")


def _matches(
    data: object, path: str, at: Location = (), stars: tuple[str, ...] = ()
) -> Iterator[tuple[Location, tuple[str, ...], Any]]:
    """All that a path leads to: where it is, what the stars stand for, and the value."""
    step, _, rest = path.partition(".")
    if not step:
        yield at, stars, data
        return
    entries = data.items() if isinstance(data, Mapping) else enumerate(data) if isinstance(data, list) else ()
    for key, value in entries:
        if step in {EACH, str(key)}:
            has_name = isinstance(data, list) and isinstance(value, Mapping)
            star = str(value.get("name", key) if has_name else key)
            yield from _matches(value, rest, (*at, key), (*stars, star) if step == EACH else stars)


def _found(data: object, path: str | None) -> Any:  # noqa: ANN401 - of any file
    return None if path is None else next((value for _, _, value in _matches(data, path)), None)


def _named(mapping: PlacesMapping, file: YamlFile) -> Iterator[tuple[str, Location, object]]:
    """The entries that are meant and have a name: the name, where the entry is, and the entry."""
    for where, stars, entry in _matches(file.data, mapping.each):
        pattern = mapping.name or " ".join(EACH for _ in stars)
        left = iter(stars)
        name = (
            re.sub(r"\*", lambda _, left=left: next(left, ""), pattern)
            if EACH in pattern
            else _found(entry, pattern)
        )
        text = " ".join(str(name).split()) if isinstance(name, str | int | float) else ""
        is_meant = all(_found(entry, path) == value for path, value in mapping.where.items())
        if text and is_meant and text not in mapping.skip:
            yield text, where, entry


def _expect_new(name: str, found: Mapping[str, Place]) -> None:
    other = found.get(_folded(name))
    if other is not None:
        same = f'there are two places "{name}"'
        alike = f'the places "{other.name}" and "{name}" differ in capitals only'
        raise ValueError(f"{same if other.name == name else alike}; rename one")


def _place(
    name: str, entry: object, mapping: PlacesMapping, to_metres: Callable[[object, object], Point]
) -> Place:
    """The place in an entry; a ValueError says what is wrong with it."""
    corners, polygon = _found(entry, mapping.polygon), None
    if corners is not None:
        polygon = tuple(to_metres(*_shape(one)[:2]) for one in (corners if isinstance(corners, list) else ()))
        if len(polygon) < LEAST_CORNERS or not all(map(math.isfinite, itertools.chain(*polygon))):
            raise ValueError(f'the polygon of "{name}" needs at least three corners [x, y]; correct it')
    pose = _found(entry, mapping.pose.at)
    paths = mapping.pose.x, mapping.pose.y, mapping.pose.yaw
    x, y, turn = (_found(pose, path) for path in paths) if any(paths) else _shape(pose)
    if polygon and x is y is None and (pose is None or pose is entry):
        x, y = (sum(values) / len(polygon) for values in zip(*polygon, strict=True))
        if not is_within((x, y), polygon):
            raise ValueError(f'the middle of "{name}" is outside its polygon; give it x and y')
    else:
        x, y = to_metres(x, y)
    yaw = _yaw(turn, mapping.yaw)
    for part, value in (("x", x), ("y", y), ("yaw", yaw)):
        if not math.isfinite(value):
            raise ValueError(f'the place "{name}" has no number for {part}; correct it')
    return Place(name, x, y, yaw, polygon)


def _shape(pose: object) -> tuple[object, object, object]:
    """The x, y and yaw or quaternion of a pose of one of the usual shapes; None for what is not there."""
    match pose:
        case {"position": {"x": x, "y": y} | [x, y, *_], **more}:
            return x, y, more.get("orientation")
        case {"x": x, "y": y, **more}:
            return x, y, more.get("yaw")
        case [x, y]:
            return x, y, None
        case [x, y, turn]:
            return x, y, turn
        case [x, y, _, *turn] if len(turn) == len("xyzw"):
            return x, y, turn
    return None, None, None


def _yaw(turn: object, unit: str) -> float:
    """Radians of an angle or of a quaternion of any length."""
    match turn:
        case {"x": _, "y": _, "z": _, "w": _} | [_, _, _, _]:
            parts = [turn[part] for part in "xyzw"] if isinstance(turn, Mapping) else turn
            x, y, z, w = map(_number, parts)
            return math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    number = 0.0 if turn is None else _number(turn)
    return math.radians(number) if unit == "degrees" else number


def _to_metres(pixels: PixelsForm | None, file: YamlFile) -> Callable[[object, object], Point]:
    """What makes metres of two coordinates of a file: they are metres, or pixels counted from the top left."""
    if pixels is None:
        return lambda x, y: (_number(x), _number(y))
    given = (pixels.resolution, pixels.origin, pixels.height)
    resolution, origin, height = (_found(file.data, one) if isinstance(one, str) else one for one in given)
    corner = [*origin, 0.0][:3] if isinstance(origin, list | tuple) else ()
    numbers = [_number(one) for one in (resolution, height, *corner)]
    if len(numbers) < 5 or not all(map(math.isfinite, numbers)) or numbers[0] <= 0:
        raise UserError(
            '"pixels" needs numbers, or paths to numbers in this file: a resolution, an origin [x, y]',
            file=file.name,
        )
    scale, start = cmath.rect(numbers[0], numbers[4]), complex(*numbers[2:4])

    def from_pixels(x: object, y: object) -> Point:
        point = start + scale * complex(_number(x), numbers[1] - _number(y))
        return point.real, point.imag

    return from_pixels


def _number(value: object) -> float:
    """A number, also as a text, since YAML takes 1e-05 for one; not a number if it is none."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan
