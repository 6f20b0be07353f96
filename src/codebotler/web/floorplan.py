"""Draw a map of the rooms as SVG, with the robot, its path and what it has found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

from codebotler.core.terminal import shortened
from codebotler.core.world import Point, Room, World, is_within, laid_out

_MARGIN = 0.6
MAX_DRAWN_ROOMS = 100
_LETTER_WIDTH = 0.62
"""The width of a letter, relative to its height."""

_MIN_LETTER, _MAX_LETTER, _MAX_PLACE_LETTER, _FIND_LETTER = 0.2, 0.62, 0.34, 0.44
_HALO_RADIUS = 0.62  # metres
_MAX_LABEL_CHARACTERS, _MAX_FINDS = 60, 3


@dataclass(frozen=True)
class MapState:
    """The changing part of a map: where the robot is and was, what it holds, and what it has found.

    Args:
        at: the robot's position in metres, if known.
        room: the robot's room or destination; empty if it is unknown or between rooms.
        is_driving: whether `room` is the destination.
        trail: the robot's previous positions in metres.
        finds: the objects and people that the robot has found, by room.
        held: the object that the robot holds; empty if there is none.
    """

    at: Point | None = None
    room: str = ""
    is_driving: bool = False
    trail: Sequence[Point] = ()
    finds: Mapping[str, Sequence[str]] = field(default_factory=dict)
    held: str = ""

    @property
    def sentence(self) -> str:
        """The map in words: `The robot is in kitchen. Found in kitchen: cup.`, for screen readers."""
        where = "is between rooms" if self.at else ""
        if self.room:
            where = f"{'is driving to' if self.is_driving else 'is in'} {self.room}"
        holds = f" and is holding {self.held}" if self.held else ""
        parts = [f"The robot {where}{holds}." if where else "The robot's position is unknown."]
        parts += [f"Found in {room}: {', '.join(names)}." for room, names in self.finds.items()]
        return " ".join(parts)


def floorplan(world: World, state: MapState) -> str:
    """Return a map of a world with the robot, seen from above, as SVG text."""
    rooms = laid_out(world).rooms[:MAX_DRAWN_ROOMS]
    points = [corner for one in rooms for corner in one.footprint or ()]
    points += [*state.trail, *([state.at] if state.at else [])]
    left, right = min(x for x, _ in points) - _MARGIN, max(x for x, _ in points) + _MARGIN
    low, high = min(y for _, y in points) - _MARGIN, max(y for _, y in points) + _MARGIN

    def on_map(point: Point) -> Point:
        return point[0] - left, high - point[1]

    names: list[str] = []
    parts: list[str] = []
    for one in rooms:
        assert one.footprint is not None, "rooms are laid out"
        look = ("goal" if state.is_driving else "here") if one.name == state.room else ""
        corners = [on_map(corner) for corner in one.footprint]
        parts.append(f'<polygon class="room {look}" points="{_svg_points(corners)}"/>')
        within = [on_map(y)[1] for other in rooms if other.within == one.name for y in other.footprint or ()]
        floor = min(within) if within and one.stand_at else None
        names += _labels(one, corners, on_map, state.finds.get(one.name, ()), floor)
    if len(state.trail) > 1:
        parts.append(f'<polyline class="trail" points="{_svg_points(map(on_map, state.trail))}"/>')
    if state.at is not None:
        x, y = on_map(state.at)
        parts.append(_robot(x, y))
        if state.held:
            held = f"holding {shortened(state.held, _MAX_LABEL_CHARACTERS)}"
            parts.append(_text(x, y + _HALO_RADIUS + 0.12, _FIND_LETTER, held, "held"))
    about = escape(shortened(f"Map of {len(rooms)} rooms. {state.sentence}", 400))
    return (
        f'<svg class="floorplan" viewBox="0 0 {right - left:.2f} {high - low:.2f}" role="img" '
        f'aria-label="{about}">{"".join([*parts, *names])}</svg>'
    )


def room_at(rooms: Iterable[Room], at: Point) -> str:
    """Return the name of the room that contains a point, or an empty string if no room does."""
    return next((one.name for one in rooms if one.footprint and is_within(at, one.footprint)), "")


def _svg_points(points: Iterable[Point]) -> str:
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in points)


def _robot(x: float, y: float) -> str:
    at = f'cx="{x:.2f}" cy="{y:.2f}"'
    halo = f'<circle class="halo" {at} r="{_HALO_RADIUS}"/>'
    return f'<g class="robot">{halo}<circle class="body" {at} r=".34"/></g>'


def _labels(
    room: Room,
    corners: Sequence[Point],
    on_map: Callable[[Point], Point],
    finds: Sequence[str],
    floor: float | None = None,
) -> Iterator[str]:
    """Yield a room's name at the wall farther from the robot, and its finds beside the name if they fit.

    If the room has places, `floor` is where they begin, so that no label covers them.
    """
    top, bottom = min(y for _, y in corners), max(y for _, y in corners)
    bottom = bottom if floor is None or floor <= top + _HALO_RADIUS else floor
    left, right = min(x for x, _ in corners), max(x for x, _ in corners)
    middle, stop = (left + right) / 2, on_map(room.stand_at)[1] if room.stand_at else bottom
    lines = _wrap(shortened(room.name, _MAX_LABEL_CHARACTERS))
    size = _size(lines, right - left, _MAX_PLACE_LETTER if room.within else _MAX_LETTER)
    is_above = stop >= (top + bottom) / 2
    start = top + 1.2 * size if is_above else bottom - size * (1.15 * (len(lines) - 1) + 0.5)
    for number, line in enumerate(lines):
        yield _text(middle, start + 1.15 * size * number, size, line, "name")
    labels = [shortened(one, _MAX_LABEL_CHARACTERS) for one in finds[-_MAX_FINDS:]]
    small = _size(labels or [""], right - left, min(size, _FIND_LETTER))
    named, found = size * (1.15 * len(lines) + 0.35), small * 1.15 * len(labels)
    fits = max(stop - top, bottom - stop) - _HALO_RADIUS >= named + found
    if is_above:
        first = top + named + 0.85 * small if fits else bottom - found + 0.65 * small
    else:
        first = bottom - named - found + 0.85 * small if fits else top + 1.2 * small
    for number, one in enumerate(labels):
        yield _text(middle, first + 1.15 * small * number, small, one, "find")


def _size(lines: Sequence[str], width: float, largest: float) -> float:
    size = width * 0.92 / (_LETTER_WIDTH * max(1, *map(len, lines)))
    return max(_MIN_LETTER, min(largest, size))


def _text(x: float, y: float, size: float, text: str, kind: str) -> str:
    return f'<text class="{kind}" x="{x:.2f}" y="{y:.2f}" font-size="{size:.2f}">{escape(text)}</text>'


def _wrap(name: str) -> list[str]:
    """Split a long name into two lines of similar length."""
    words = name.split()
    if len(words) < 2 or len(name) < 9:  # noqa: PLR2004 - needs two words; shorter names fit
        return [name]
    at = min(range(1, len(words)), key=lambda n: max(len(" ".join(words[:n])), len(" ".join(words[n:]))))
    return [" ".join(words[:at]), " ".join(words[at:])]
