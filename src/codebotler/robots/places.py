"""Read a robot's places from files in our own format or, through a mapping, from any YAML or JSON file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict

from codebotler.core.text.words import brief
from codebotler.core.world import Point, Room, World, is_within
from codebotler.core.world_file import Corner, Metres, Name, YamlValue
from codebotler.core.yaml_files import YamlFile

WILDCARD = "*"  # a path step that matches every entry
COORDINATE_COUNTS = (2, 3, 7)  # the lengths of points, poses with a yaw, and poses with a quaternion

Steps: TypeAlias = tuple[str | int, ...]
Match: TypeAlias = tuple[Steps, Steps, Any]


@dataclass(frozen=True)
class NamedPlace:
    """A named place that the robot can drive to: a pose and, if known, the polygon around it."""

    name: str  # the name, which must be unique regardless of case
    x: float  # the position in metres where the robot stops
    y: float
    yaw: float = 0.0  # the angle in radians, counterclockwise from the x axis
    polygon: tuple[Point, ...] | None = None  # three or more corners in metres; None if unknown


@dataclass(frozen=True)
class Places:
    """The places of a robot (at least one) and the coordinate frame they are in, such as `map`."""

    frame: str
    places: tuple[NamedPlace, ...]

    def world(self, robot: str = "") -> World:
        """Return a world with these places as its rooms. `robot` is the name of the starting room."""
        rooms = (Room(one.name, footprint=one.polygon, stand_at=(one.x, one.y)) for one in self.places)
        return World(tuple(rooms), robot)

    def room_at(self, x: float, y: float) -> NamedPlace | None:
        """Return the smallest place whose polygon contains a point in metres, or None if there is none."""
        around = (one for one in self.places if one.polygon and is_within((x, y), one.polygon))
        return min(around, key=lambda one: _area(one.polygon or ()), default=None)

    def nearest(self, x: float, y: float) -> NamedPlace:
        """Return the place whose stopping position is nearest to a point in metres."""
        return min(self.places, key=lambda one: math.dist((one.x, one.y), (x, y)))

    def named(self, text: str) -> NamedPlace | None:
        """Return the place with this name, ignoring case and outer spaces, or None if there is none."""
        return next((one for one in self.places if one.name.casefold() == text.strip().casefold()), None)


def _area(corners: Sequence[Point]) -> float:
    edges = zip(corners, [*corners[1:], *corners[:1]], strict=True)
    return abs(sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in edges)) / 2


class _PlacesForm(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, coerce_numbers_to_str=True)


class PlacesFile(_PlacesForm):
    """The structure of a places file in CodeBotler's own format: a frame, and the places by name."""

    frame: Name = "map"
    places: dict[Name, dict[Literal["x", "y", "yaw", "polygon"], Any]]


class PlacesMapping(_PlacesForm):
    """Says where to find places in a YAML or JSON file. In a path such as `rooms.*`, `*` matches any key."""

    file: Name
    frame: Name = "map"
    each: str = "places.*"
    where: dict[str, YamlValue] = {}
    name: str = ""
    pose: str | list[str] = ""
    polygon: str = "polygon"
    yaw: Literal["radians", "degrees"] = "radians"
    resolution: Metres | None = None  # metres per pixel if positions are pixels from the image's top left
    origin: Corner | tuple[Metres, Metres, Metres] = (0.0, 0.0)  # the image's lower left corner in metres
    height: Metres = 0.0  # the height of the image in pixels
    skip: list[str] = []


def read_places(source: object, at: YamlFile) -> Places:
    """Read the places of a robot, or raise UserError if a file is invalid.

    `source` is the value of `places` in the file `at`: a file name, a mapping, or a list of these.
    """
    found: dict[str, NamedPlace] = {}
    frames: list[str] = []
    for number, one in enumerate(source if isinstance(source, list) and source else [source]):
        here = ("places", number) if isinstance(source, list) else ("places",)
        mapping = at.validate(PlacesMapping, {"file": one} if isinstance(one, str) else one, at=here)
        file = YamlFile.read(Path(at.name).parent / mapping.file)
        frames.append(file.validate(PlacesFile).frame if isinstance(one, str) else mapping.frame)
        if frames[-1] != frames[0]:
            raise at.wrong(f'the frame is "{frames[-1]}" here, but "{frames[0]}" above; use one frame', *here)
        entries = [*_find_entries(mapping, file.data)]
        if not entries:
            sentence = f'"{mapping.each}" matches no named place in {file.name}'
            raise at.wrong(f'{sentence}; correct "each" or "name"', *here, "each")
        for name, where, entry in entries:
            try:
                found[name.casefold()] = _make_place(name, entry, mapping, found)
            except ValueError as error:
                fix = f'correct it, or leave it out with "skip: [{name}]"'
                raise file.wrong(f'the place "{name}" cannot be read: {error}; {fix}', *where) from None
    return Places(frames[0], tuple(found.values()))


def _matches(data: object, path: str, at: Steps = (), stars: Steps = ()) -> Iterator[Match]:
    """Yield each match of a path: its location, the keys that matched wildcards, and its value."""
    step, _, rest = path.partition(".")
    if not step:
        yield at, stars, data
        return
    entries = enumerate(data) if isinstance(data, list) else data.items() if isinstance(data, dict) else ()
    for key, value in entries:
        if step in {WILDCARD, str(key)}:
            is_key = step == WILDCARD and isinstance(data, dict)
            yield from _matches(value, rest, (*at, key), (*stars, key) if is_key else stars)


def _find(data: object, path: str) -> Any:  # noqa: ANN401 - of any file
    return next((value for _, _, value in _matches(data, path)), None)


def _find_entries(mapping: PlacesMapping, data: object) -> Iterator[tuple[str, Steps, Any]]:
    """Yield the name, location and value of each entry that the mapping selects and that has a name."""
    for where, stars, entry in _matches(data, mapping.each):
        name = mapping.name or " ".join(WILDCARD for _ in stars)
        if WILDCARD not in name:
            value = _find(entry, name)
            name = str(value).strip() if isinstance(value, str | int) else ""
        for star in stars:
            name = name.replace(WILDCARD, str(star).strip(), 1)
        is_meant = all(_find(entry, path) == value for path, value in mapping.where.items())
        if name and name not in mapping.skip and is_meant:
            yield name, where, entry


def _make_place(
    name: str, entry: object, mapping: PlacesMapping, others: Mapping[str, NamedPlace]
) -> NamedPlace:
    """Convert an entry to a place, or raise ValueError if it is invalid."""
    if other := others.get(name.casefold()):
        raise ValueError(f'the name is already taken by "{other.name}" (names are case-insensitive)')
    corners, paths, size = _find(entry, mapping.polygon), mapping.pose, mapping.resolution
    polygon = [(x, y) for x, y, *_ in map(_numbers, corners)] if isinstance(corners, list) else []
    if corners is not None and not polygon[2:]:
        raise ValueError("the polygon has fewer than three corners")
    pose = _find(entry, paths) if isinstance(paths, str) else [_find(entry, path) for path in paths]
    if polygon and (pose is None or (pose is entry and _find(entry, "x") is None)):
        pose = [sum(parts) / len(polygon) for parts in zip(*polygon, strict=True)]
        if not is_within((pose[0], pose[1]), polygon):
            raise ValueError("the place needs x and y, because the middle of its corners is not inside it")
    x, y, *turn = _numbers(pose)
    points = [(x, y), *polygon]
    if size is not None:
        (left, low, *_), high = mapping.origin, mapping.height
        points = [(left + size * x, low + size * (high - y)) for x, y in points]
    yaw = [*turn, 0.0][0] * (math.pi / 180 if mapping.yaw == "degrees" else 1)
    if turn[1:]:
        _, x, y, z, w = turn
        yaw = math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return NamedPlace(name, *points[0], yaw, tuple(points[1:]) or None)


def _numbers(value: Any) -> list[float]:  # noqa: ANN401 - of any file
    """Return the numbers of a corner or a pose: x and y, then optionally a yaw, or z and a quaternion."""
    match value:
        case {"position": point, "orientation": {"x": x, "y": y, "z": z, "w": w}}:
            value = [*_numbers(point)[:2], 0.0, x, y, z, w]
        case {"x": x, "y": y, **more}:
            value = [x, y, more.get("yaw", 0.0)]
    with suppress(TypeError, ValueError, OverflowError):
        numbers = [float(one) for one in value] if isinstance(value, list) else []
        if len(numbers) in COORDINATE_COUNTS and all(map(math.isfinite, numbers)):
            return numbers
    raise ValueError(f"{brief(str(value))} is not a point or pose of finite numbers")
