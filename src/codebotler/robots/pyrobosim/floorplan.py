"""Plan a floor with walls, doors and tables for a world. This module imports slowly."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import shapely
from shapely.geometry import LineString, MultiPoint, Point, Polygon, box
from shapely.ops import nearest_points

from codebotler.core.world import HALLWAY, ROOM_DEPTH, World, laid_out
from codebotler.robots.base import NotReadyError

XY = tuple[float, float]

# All lengths are in metres.
ROBOT_RADIUS = 0.15
WALL_THICKNESS = 0.1  # half of it on each side of a footprint's edge
PASSAGE_WIDTH = 0.5
PASSAGE_DEPTH = 0.25  # the distance from a passage's end to the nearest wall of the room
PASSAGE_OVERLAP = 0.1  # extra length at each end, so that the free spaces of rooms and passages overlap
PASSAGE_STEP = 0.2  # the distance between two starting points to try for a passage
SLACK = 0.02  # the minimum gap between two objects
TABLE_SIDE = 0.1  # tables are squares, small enough for any room
TABLE_REACH = TABLE_SIDE / 2 + ROBOT_RADIUS + SLACK
TABLE_STANDS = (
    (-TABLE_REACH, 0.0, 0.0),
    (TABLE_REACH, 0.0, math.pi),
    (0.0, -TABLE_REACH, math.pi / 2),
    (0.0, TABLE_REACH, -math.pi / 2),
)
"""The robot's pose at each side of a table: x and y relative to its centre, and the yaw that faces it."""

MAX_LINES = 300  # the most passages to try between two rooms
TABLE_POSITIONS = 12  # the number of positions to try along each axis of a room


@dataclass(frozen=True)
class Passage:
    """A door between adjacent rooms, or a straight hallway between rooms that are apart."""

    ends: tuple[int, int]  # the indices of the two floors that it connects
    line: LineString  # the centre line, which starts inside one floor and ends inside the other

    @property
    def area(self) -> Polygon:
        """The part of the floor that the passage covers."""
        return self.line.buffer(PASSAGE_WIDTH / 2, cap_style="flat")


@dataclass(frozen=True)
class Floorplan:
    """The rooms of a world with their stopping positions, passages and tables."""

    floors: tuple[Polygon, ...]  # the floor of each room in the order of the world, then the corridor, if any
    stands: tuple[Point, ...]  # the robot's stopping position on each floor
    passages: tuple[Passage, ...]
    tables: tuple[XY | None, ...]  # the centre of the table in each room, or None

    def corners(self, number: int) -> list[XY]:
        """Return the points of floor `number` where a path may turn: the corners of its free space."""
        table = self.tables[number] if number < len(self.tables) else None
        space = _without(_free(self.floors[number]), table)
        return [corner for ring in (space.exterior, *space.interiors) for corner in ring.coords[:-1]]


def plan_floor(world: World) -> Floorplan:
    """Plan the floors, passages and tables for the rooms of a world.

    Rooms without a footprint are placed on both sides of a corridor. Passages join the nearest rooms until
    all are connected, if they fit. In a world with objects, each room gets a table if there is space.

    Raises:
        NotReadyError: rooms overlap or are too narrow, or no table fits into a room with objects.
    """
    rooms = laid_out(world).rooms
    floors = [_floor(room.name, room.footprint or ()) for room in rooms]
    for (room, floor), (other, other_floor) in itertools.combinations(zip(rooms, floors, strict=True), 2):
        if floor.distance(other_floor) < WALL_THICKNESS / 2:
            raise NotReadyError(f'the rooms "{room.name}" and "{other.name}" overlap; move one of the two')
    stops = [Point(room.stand_at or (0.0, 0.0)) for room in rooms]
    along = [floor for room, floor in zip(world.rooms, floors, strict=True) if room.footprint is None]
    if along:
        floors.append(_corridor(along))
        stops.append(floors[-1].centroid)
    stands = [nearest_points(_free(f, SLACK), point)[0] for f, point in zip(floors, stops, strict=True)]
    passages = _passages(floors, stands)
    clear = [[stand, *(p.area for p in passages if n in p.ends)] for n, stand in enumerate(stands)]
    has_objects = any(room.objects for room in rooms)
    tables = [_table(floors[n], clear[n]) if has_objects else None for n in range(len(rooms))]
    for room, table in zip(rooms, tables, strict=True):
        if room.objects and table is None:
            raise NotReadyError(f'no table fits into "{room.name}", which has objects; make the room larger')
    return Floorplan(tuple(floors), tuple(stands), tuple(passages), tuple(tables))


def _floor(name: str, footprint: Sequence[XY]) -> Polygon:
    """Return the floor of a room, which is its footprint without the walls."""
    outer = Polygon(footprint)
    floor = _shrink(outer, WALL_THICKNESS / 2) if outer.is_valid else Polygon()
    passable = _shrink(floor, PASSAGE_DEPTH)
    if floor.geom_type != "Polygon" or passable.geom_type != "Polygon" or passable.is_empty:
        least = WALL_THICKNESS + 2 * PASSAGE_DEPTH
        mend = f"make its footprint wider than {least:g} m everywhere, without crossing edges"
        raise NotReadyError(f'the room "{name}" is too narrow; {mend}')
    return floor


def _corridor(along: Sequence[Polygon]) -> Polygon:
    """Return the floor of the corridor between the two rows of rooms."""
    left, _, right, _ = MultiPoint([corner for floor in along for corner in floor.exterior.coords]).bounds
    return _shrink(box(left, ROOM_DEPTH, right, ROOM_DEPTH + HALLWAY), WALL_THICKNESS / 2)


def _shrink(area: Polygon, by: float) -> Polygon:
    return area.buffer(-by, join_style="mitre")


def _free(floor: Polygon, slack: float = 0.0) -> Polygon:
    """Return the positions on a floor that the robot's centre can take."""
    return _shrink(floor, ROBOT_RADIUS + slack)


def _table_area(centre: XY, margin: float = 0.0) -> Polygon:
    return Point(centre).buffer(TABLE_SIDE / 2 + margin, cap_style="square")


def _without(free: Polygon, table: XY | None) -> Polygon:
    return free if table is None else free.difference(_table_area(table, ROBOT_RADIUS))


def _passages(floors: Sequence[Polygon], stands: Sequence[Point]) -> list[Passage]:
    """Connect floors, nearest first, until all can be reached or no further passage fits."""
    joined = list(range(len(floors)))
    found: list[Passage] = []
    pairs = itertools.combinations(range(len(floors)), 2)
    # Among floors that are equally near, prefer the corridor, which is the last floor.
    for a, b in sorted(pairs, key=lambda ab: (round(floors[ab[0]].distance(floors[ab[1]]), 3), -ab[1])):
        passage = _passage((a, b), floors, stands, found) if joined[a] != joined[b] else None
        if passage is not None:
            found.append(passage)
            joined = [joined[a] if group == joined[b] else group for group in joined]
    return found


def _passage(
    ends: tuple[int, int], floors: Sequence[Polygon], stands: Sequence[Point], others: Sequence[Passage]
) -> Passage | None:
    """Return the shortest unobstructed passage between two floors, preferably near both stops, or None."""
    first, second = (floors[end] for end in ends)
    obstacles = [floor.buffer(WALL_THICKNESS / 2) for n, floor in enumerate(floors) if n not in ends]
    obstacles += [passage.area.buffer(WALL_THICKNESS / 2) for passage in others]
    blocked = shapely.union_all(obstacles)
    lines = sorted(
        _lines(first, second),
        key=lambda line: (round(line.length, 1), sum(line.distance(stands[end]) for end in ends)),
    )
    free = shapely.union_all([_free(first), _free(second)])
    for line in lines:
        passage = Passage(ends, line)
        space = free.union(_shrink(passage.area, ROBOT_RADIUS)).buffer(1e-6)
        if space.covers(line) and passage.area.disjoint(blocked):
            return passage
    return None


def _lines(first: Polygon, second: Polygon) -> Iterator[LineString]:
    """Yield straight centre lines for passages from inside one floor to inside another."""
    edge, other = _shrink(first, PASSAGE_DEPTH).exterior, _shrink(second, PASSAGE_DEPTH)
    count = min(MAX_LINES, max(4, math.ceil(edge.length / PASSAGE_STEP)))
    for number in range(count):
        start, end = nearest_points(edge.interpolate((number + 0.5) * edge.length / count), other)
        share = PASSAGE_OVERLAP / start.distance(end)
        dx, dy = (end.x - start.x) * share, (end.y - start.y) * share
        yield LineString([(start.x - dx, start.y - dy), (end.x + dx, end.y + dy)])


def _table(floor: Polygon, keep_clear: Sequence[shapely.Geometry]) -> XY | None:
    """Return where a table fits, as far from stops and passages as possible, or None."""
    left, low, right, high = floor.bounds
    width, depth = (right - left) / TABLE_POSITIONS, (high - low) / TABLE_POSITIONS
    clear = shapely.union_all(keep_clear)
    numbers = itertools.product(range(TABLE_POSITIONS), repeat=2)
    centres = [(left + (i + 0.5) * width, low + (j + 0.5) * depth) for i, j in numbers]
    centres.sort(key=lambda centre: -_table_area(centre).distance(clear))
    return next((centre for centre in centres if _fits(centre, floor, clear)), None)


def _fits(centre: XY, floor: Polygon, clear: shapely.Geometry) -> bool:
    """Return whether a table fits and leaves room for the robot to reach it and drive around it."""
    table, (x, y) = _table_area(centre), centre
    if not floor.contains(table) or table.distance(clear) <= ROBOT_RADIUS + SLACK:
        return False
    space = _without(_free(floor), centre)
    sides = [Point(x + dx, y + dy) for dx, dy, _ in TABLE_STANDS]
    return space.geom_type == "Polygon" and any(map(space.contains, sides))
