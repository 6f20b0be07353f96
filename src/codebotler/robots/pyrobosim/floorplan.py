"""A floor plan with walls, doors and tables for a world file. Importing this is slow."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import shapely
from shapely.geometry import LineString, MultiPoint, Point, Polygon, box
from shapely.geometry.polygon import orient
from shapely.ops import nearest_points

from codebotler.core.world import HALLWAY, ROOM_DEPTH, World, laid_out
from codebotler.robots.base import NotReadyError

XY = tuple[float, float]

# All in metres.
RADIUS = 0.15  # of the robot
WALL = 0.1  # half of it stands on either side of the edge of a footprint
DOORS = (0.8, 0.5)  # widths of passages; the first that fits
DEEP = 0.25  # from all walls, where passages begin and end
BEYOND = 0.1  # that they go on there, so that the free spaces of rooms and passages overlap
STEP = 0.2  # between two places where a passage could begin
TABLES = ((1.2, 0.6), (0.8, 0.5), (0.4, 0.4), (0.2, 0.2), (0.1, 0.1))  # the first that fits
SLACK = 0.02  # between things that do not touch

LINES = 300  # ways from one room to another that are tried at most
PLACES = 12  # for a table, in each direction


@dataclass(frozen=True)
class Passage:
    """A door, or a way between two rooms that do not touch."""

    ends: tuple[int, int]  # the floors it joins
    line: LineString  # in its middle, from within one floor to within the other
    width: float

    @property
    def area(self) -> Polygon:
        """The ground it takes."""
        return self.line.buffer(self.width / 2, cap_style="flat")


@dataclass(frozen=True)
class Table:
    """A table, with its sides along the axes."""

    centre: XY
    size: XY

    @property
    def area(self) -> Polygon:
        """The ground it takes."""
        (x, y), (width, depth) = self.centre, self.size
        return box(x - width / 2, y - depth / 2, x + width / 2, y + depth / 2)

    @property
    def stands(self) -> list[tuple[float, float, float]]:
        """Where the robot can reach it, before each side: from its centre, and the angle to face it."""
        along, across = (side / 2 + RADIUS + SLACK for side in self.size)
        return [
            (-along, 0.0, 0.0),
            (along, 0.0, math.pi),
            (0.0, -across, math.pi / 2),
            (0.0, across, -math.pi / 2),
        ]

    def cells(self, count: int) -> tuple[list[XY], float]:
        """The middles of at least so many cells of its top, and the narrower side of a cell."""
        columns = math.ceil(math.sqrt(count))
        rows = math.ceil(count / columns)
        left, low, _, _ = self.area.bounds
        width, depth = self.size[0] / columns, self.size[1] / rows
        grid = itertools.product(range(rows), range(columns))
        return [(left + (i + 0.5) * width, low + (j + 0.5) * depth) for j, i in grid], min(width, depth)


@dataclass(frozen=True)
class Floorplan:
    """The rooms of a world with all that a robot must know to drive through them."""

    floors: tuple[Polygon, ...]  # of rooms within their walls, in the order of the world; perhaps a corridor
    stands: tuple[Point, ...]  # where the robot stops on each floor
    passages: tuple[Passage, ...]
    tables: tuple[Table | None, ...]  # one for each room

    def corners(self, number: int) -> list[XY]:
        """What the robot drives around on a floor: the corners of its free space that point into it."""
        table = self.tables[number] if number < len(self.tables) else None
        space = orient(_without(_free(self.floors[number]), table))
        rings = (space.exterior, *space.interiors)
        return [corner for ring in rings for corner in _turning_right(ring.coords[:-1])]


def plan_floor(world: World) -> Floorplan:
    """The floor plan of a world.

    Rooms without a footprint stand on both sides of a corridor, with a door each. Of the others, each has a
    passage to the nearest one, until all can be reached. If there are objects, each room has a table if one
    fits.

    Raises:
        NotReadyError: rooms overlap or are too narrow, or no table fits into a room with objects.
    """
    rooms = laid_out(world).rooms
    floors = [_floor(room.name, room.footprint or ()) for room in rooms]
    for (room, floor), (other, beside) in itertools.combinations(zip(rooms, floors, strict=True), 2):
        if floor.distance(beside) < WALL / 2:
            raise NotReadyError(f'the rooms "{room.name}" and "{other.name}" overlap; move one of them')
    wanted = [Point(room.stand_at or (0.0, 0.0)) for room in rooms]
    along = [floor for room, floor in zip(world.rooms, floors, strict=True) if room.footprint is None]
    if along:
        floors.append(_corridor(along))
        wanted.append(floors[-1].centroid)
    stands = [nearest_points(_free(f, SLACK), point)[0] for f, point in zip(floors, wanted, strict=True)]
    passages = _passages(floors, stands)
    clear = [[stand, *(p.area for p in passages if n in p.ends)] for n, stand in enumerate(stands)]
    are_wanted = any(room.objects for room in rooms)
    tables = [_table(floors[n], clear[n]) if are_wanted else None for n in range(len(rooms))]
    for room, table in zip(rooms, tables, strict=True):
        if room.objects and table is None:
            raise NotReadyError(f'no table fits into "{room.name}", which has objects; make it larger')
    return Floorplan(tuple(floors), tuple(stands), tuple(passages), tuple(tables))


# --- rooms


def _floor(name: str, footprint: Sequence[XY]) -> Polygon:
    """A room within its walls."""
    outer = Polygon(footprint)
    floor = _smaller(outer, WALL / 2) if outer.is_valid else Polygon()
    passable = _smaller(floor, DEEP)
    if floor.geom_type != "Polygon" or passable.geom_type != "Polygon" or passable.is_empty:
        raise NotReadyError(
            f'the robot cannot pass everywhere in "{name}"; its footprint must be more than '
            f"{WALL + 2 * DEEP:g} m wide everywhere, and its edges must not cross"
        )
    return floor


def _corridor(along: Sequence[Polygon]) -> Polygon:
    """The hallway that the layout leaves between two rows of rooms."""
    left, _, right, _ = MultiPoint([corner for floor in along for corner in floor.exterior.coords]).bounds
    return _smaller(box(left, ROOM_DEPTH, right, ROOM_DEPTH + HALLWAY), WALL / 2)


def _smaller(area: Polygon, by: float) -> Polygon:
    return area.buffer(-by, join_style="mitre")


def _free(floor: Polygon, slack: float = 0.0) -> Polygon:
    """Where the middle of the robot can be."""
    return _smaller(floor, RADIUS + slack)


def _without(free: Polygon, table: Table | None) -> Polygon:
    return free if table is None else free.difference(table.area.buffer(RADIUS, join_style="mitre"))


def _turning_right(ring: Sequence[XY]) -> Iterator[XY]:
    """The corners that turn right, with the free space on the left."""
    for (ax, ay), (bx, by), (cx, cy) in zip(ring, [*ring[1:], ring[0]], [*ring[2:], *ring[:2]], strict=True):
        if (bx - ax) * (cy - by) - (by - ay) * (cx - bx) < 0:
            yield bx, by


# --- passages


def _passages(floors: Sequence[Polygon], stands: Sequence[Point]) -> list[Passage]:
    """Join the nearest floors, until all can be reached or no more can be joined."""
    joined = list(range(len(floors)))
    found: list[Passage] = []

    def distance(pair: tuple[int, int]) -> tuple[float, int]:
        """Of equal distances, that to the corridor comes first, which is the last of the floors."""
        first, second = pair
        return round(floors[first].distance(floors[second]), 3), -second

    for a, b in sorted(itertools.combinations(range(len(floors)), 2), key=distance):
        passage = _passage((a, b), floors, stands, found) if joined[a] != joined[b] else None
        if passage is not None:
            found.append(passage)
            joined = [joined[a] if group == joined[b] else group for group in joined]
    return found


def _passage(
    ends: tuple[int, int], floors: Sequence[Polygon], stands: Sequence[Point], others: Sequence[Passage]
) -> Passage | None:
    """The shortest way between two floors that crosses no others; of equals, the nearest to both stands."""
    first, second = (floors[end] for end in ends)
    obstacles = [floor.buffer(WALL / 2) for n, floor in enumerate(floors) if n not in ends]
    obstacles += [passage.area.buffer(WALL / 2) for passage in others]
    in_the_way = shapely.union_all(obstacles)
    lines = sorted(
        _lines(first, second),
        key=lambda line: (round(line.length, 1), sum(line.distance(stands[end]) for end in ends)),
    )
    free = shapely.union_all([_free(first), _free(second)])
    for width, line in itertools.product(DOORS, lines):
        passage = Passage(ends, line, width)
        space = free.union(_smaller(passage.area, RADIUS)).buffer(1e-6)
        if space.covers(line) and passage.area.disjoint(in_the_way):
            return passage
    return None


def _lines(first: Polygon, second: Polygon) -> Iterator[LineString]:
    """Straight ways from within one floor to within the other."""
    edge, other = _smaller(first, DEEP).exterior, _smaller(second, DEEP)
    count = min(LINES, max(4, math.ceil(edge.length / STEP)))
    for number in range(count):
        start, end = nearest_points(edge.interpolate((number + 0.5) * edge.length / count), other)
        share = BEYOND / start.distance(end)
        dx, dy = (end.x - start.x) * share, (end.y - start.y) * share
        yield LineString([(start.x - dx, start.y - dy), (end.x + dx, end.y + dy)])


# --- tables


def _table(floor: Polygon, keep_clear: Sequence[shapely.Geometry]) -> Table | None:
    """The largest table that fits, as far as possible from where the robot stops and passes."""
    left, low, right, high = floor.bounds
    width, depth = (right - left) / PLACES, (high - low) / PLACES
    clear = shapely.union_all(keep_clear)
    for size in TABLES:
        places = [
            Table((left + (i + 0.5) * width, low + (j + 0.5) * depth), turned)
            for turned in dict.fromkeys((size, size[::-1]))
            for i, j in itertools.product(range(PLACES), repeat=2)
        ]
        for table in sorted(places, key=lambda table: -table.area.distance(clear)):
            if _fits(table, floor, clear):
                return table
    return None


def _fits(table: Table, floor: Polygon, clear: shapely.Geometry) -> bool:
    """Whether the robot can reach the table, and still pass everywhere else."""
    if not floor.contains(table.area) or table.area.distance(clear) <= RADIUS + SLACK:
        return False
    space = _without(_free(floor), table)
    (x, y) = table.centre
    sides = [Point(x + dx, y + dy) for dx, dy, _ in table.stands]
    return space.geom_type == "Polygon" and any(map(space.contains, sides))
