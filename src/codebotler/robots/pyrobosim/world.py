"""A world of ours as pyrobosim has it, with a robot that plans and drives. Importing this is heavy."""

from __future__ import annotations

import bisect
import math
import time
from collections.abc import Iterator
from typing import TypeVar

import shapely
from pyrobosim.core import Entity, Object, ObjectSpawn, Robot, Room
from pyrobosim.core import World as Pyroworld
from pyrobosim.navigation.types import PathExecutor
from pyrobosim.navigation.world_graph import WorldGraphPlanner
from pyrobosim.planning.actions import ExecutionResult, ExecutionStatus
from pyrobosim.utils.graph_types import Node
from pyrobosim.utils.path import Path
from pyrobosim.utils.pose import Pose, wrap_angle
from pyrobosim.utils.trajectory import Trajectory, get_constant_speed_trajectory
from shapely.geometry import LineString

from codebotler.core.world import World
from codebotler.robots.base import CancelledError, Feedback, untold
from codebotler.robots.clock import Clock
from codebotler.robots.pyrobosim.floorplan import RADIUS, Floorplan, Table, planned
from codebotler.robots.scripted import METRES_PER_SECOND, SECONDS, TELLS_EVERY
from codebotler.simulator.robot import RobotError

RADIANS_PER_SECOND = math.pi / 2
MOVES_EVERY = 0.05
"""Real seconds from one place on the way to the next."""

NEAR = 1e-6  # metres by which what is computed may miss the edge that it lies on
T = TypeVar("T")


class Stage:
    """A world of pyrobosim with a robot in it.

    Nothing random of pyrobosim is used: objects lie in cells of tables, and ways are planned on a graph.

    Args:
        world: as it is at the start.
        clock: by which the robot drives.

    Raises:
        NotReadyError: the rooms cannot be built as they are.
    """

    def __init__(self, world: World, clock: Clock) -> None:
        plan = planned(world)
        names = [room.name for room in world.rooms]
        self._clock, self._motor = clock, Motor(clock)
        self._world = Pyroworld(name="pyrobosim.world", inflation_radius=RADIUS, object_radius=0.0)
        self._floors = self._built(plan)
        self._rooms = dict(zip(names, self._floors, strict=False))  # the corridor has no name
        self._stands = dict(zip(names, plan.stands, strict=False))
        self._tables = {
            name: self._furnished(floor, table)
            for (name, floor), table in zip(self._rooms.items(), plan.tables, strict=True)
            if table is not None
        }
        count = sum(len(room.objects) for room in world.rooms)
        divided = {n: t.cells(count) for n, t in zip(names, plan.tables, strict=True) if t is not None}
        self._cells = {name: cells for name, (cells, _) in divided.items()}
        size = min((width for _, width in divided.values()), default=0.0) / 2
        self.objects = {room.name: self._laid(room.name, len(room.objects), size) for room in world.rooms}
        """What lies in each room at the start, by the room's name, in the order of the world."""

        for number, floor in enumerate(self._floors):
            places = [*plan.stands[number].coords, *plan.corners(number)]
            floor.nav_poses = [Pose(x, y) for x, y in places]
        self.robot = Robot(name="pyrobosim.robot", radius=RADIUS, start_sensor_threads=False)
        self.robot.set_path_executor(self._motor)
        self._world.add_robot(self.robot, loc=self._rooms[world.robot], pose=self._pose(world.robot))
        self.robot.set_path_planner(Roadmap())

    @property
    def here(self) -> str | None:
        """The room that the robot is in; None between rooms."""
        pose = self.robot.get_pose()
        return next((name for name, floor in self._rooms.items() if floor.is_inside(pose)), None)

    @property
    def held(self) -> Object | None:
        """What the robot holds."""
        return self.robot.manipulated_object

    def lying_in(self, room: str) -> list[Object]:
        """The objects in a room, in the order in which they came there."""
        return list(self._tables[room].children) if room in self._tables else []

    def drive(self, room: str, told: Feedback = untold) -> None:
        """Drive to where the robot stops in a room.

        Raises:
            RobotError: there is no way.
            CancelledError: the clock was stopped.
        """
        self._navigate(self._pose(room), told, "GoToInvalidLocation", f'drive to "{room}"')

    def pick(self, thing: Object, name: str, told: Feedback = untold) -> None:
        """Drive to the table on which an object of this room lies, and take it.

        Args:
            thing: the object.
            name: what a program calls it.
            told: where the robot is on the way.

        Raises:
            RobotError: it cannot.
            CancelledError: the clock was stopped.
        """
        what = f'pick up "{name}"'
        self._navigate(thing.parent, told, "PickFailed", what)
        self._wait(SECONDS["pick"])
        _succeed(self.robot.pick_object(thing), "PickFailed", what)

    def place(self, room: str, name: str, told: Feedback = untold) -> None:
        """Drive to the table in a room, and put down there what the robot holds.

        Args:
            room: where the robot is.
            name: what a program calls the object.
            told: where the robot is on the way.

        Raises:
            RobotError: it cannot.
            CancelledError: the clock was stopped.
        """
        what, table = f'place "{name}"', self._tables.get(room)
        if table is None:
            raise RobotError("PlaceFailed", f'the robot cannot {what}: no table has room in "{room}"')
        self._navigate(table, told, "PlaceFailed", what)
        self._wait(SECONDS["place"])
        taken = {(lying.pose.x, lying.pose.y) for lying in table.children}
        x, y = next(cell for cell in self._cells[room] if cell not in taken)
        _succeed(self.robot.place_object(Pose(x, y)), "PlaceFailed", what)

    def _navigate(self, goal: Pose | Entity, told: Feedback, kind: str, what: str) -> None:
        self._motor.told = told
        _succeed(self.robot.navigate(goal=goal), kind, what)

    def _wait(self, seconds: float) -> None:
        if not self._clock.wait(seconds):
            raise CancelledError

    def _pose(self, room: str) -> Pose:
        return Pose(self._stands[room].x, self._stands[room].y)

    # --- building

    def _built(self, plan: Floorplan) -> list[Room]:
        """The rooms, with passages between them."""
        walls = 0.001  # metres around a floor, where pyrobosim takes nothing else; the plan has left more
        floors = []
        for number, floor in enumerate(plan.floors):
            corners = list(floor.exterior.coords)
            added = self._world.add_room(name=f"floor{number}", footprint=corners, wall_width=walls)
            floors.append(_made(added))
        for passage in plan.passages:
            start, end = (floors[number] for number in passage.ends)
            hallway = self._world.add_hallway(
                room_start=start,
                room_end=end,
                width=passage.width,
                wall_width=walls,
                conn_method="points",
                conn_points=list(passage.line.coords),
            )
            _made(hallway)
        return floors

    def _furnished(self, floor: Room, table: Table) -> ObjectSpawn:
        """The top of a table that stands in a room."""
        kind = f"table on {floor.name}"
        self._world.get_location_metadata().data[kind] = {
            "footprint": {"type": "box", "dims": list(table.size)},
            "nav_poses": [[x, y, 0.0, angle] for x, y, angle in table.stands],
            "locations": [{"name": "top"}],
        }
        made = _made(self._world.add_location(category=kind, parent=floor, pose=Pose(*table.centre)))
        (top,) = made.children
        return top

    def _laid(self, room: str, count: int, size: float) -> list[Object]:
        """Objects on the table in a room."""
        metadata = self._world.get_object_metadata().data
        metadata["thing"] = {"footprint": {"type": "box", "dims": [size, size]}}
        return [
            _made(self._world.add_object(category="thing", parent=self._tables[room], pose=Pose(x, y)))
            for x, y in self._cells.get(room, [])[:count]
        ]


class Roadmap(WorldGraphPlanner):
    """pyrobosim's planner on a graph; whether places see each other is computed, where that one samples."""

    plugin_name = "codebotler"

    def reset(self) -> None:
        """Draw the graph of the world as it is."""
        world = self.robot and self.robot.world
        if world is not None:
            self._space = world.total_internal_polygon.buffer(NEAR)
            shapely.prepare(self._space)
        super().reset()

    def connect_neighbors(self, node: Node) -> None:
        """Join a place with all that are seen from there."""
        here = (node.pose.x, node.pose.y)
        for other in self.graph.nodes:
            if other is not node and self._space.covers(LineString([here, (other.pose.x, other.pose.y)])):
                self.graph.add_edge(node, other)


class Motor(PathExecutor):
    """Drives along a path by a clock, and stands still where it is when that is stopped.

    pyrobosim's own looks for a cancel between naps, and forgets one that comes before it has begun.

    Args:
        clock: by which it drives.
    """

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self.clock = clock
        self.told: Feedback = untold

    def execute(self, path: Path, *_: float, **__: float) -> ExecutionResult:
        """Drive along a path to its end, or until the clock is stopped; the clock has the speed."""
        way = get_constant_speed_trajectory(path, METRES_PER_SECOND, RADIANS_PER_SECOND)
        corners = [float(corner) for corner in way.t_pts]
        moment, told, tells = -1.0, "", 0.0
        self.following_path = True
        for moment in self._moments(corners):
            pose = _pose_at(way, moment)
            self.robot.set_pose(pose)
            if self.robot.manipulated_object is not None:
                self.robot.manipulated_object.set_pose(_pose_at(way, moment))
            phrase, now = f"at ({pose.x:.1f}, {pose.y:.1f})", time.monotonic()
            is_due = now >= tells or moment >= corners[-1] or self.clock.speed is None
            if is_due and phrase != told:
                self.told(phrase)
                told, tells = phrase, now + TELLS_EVERY
        self.following_path = False
        arrived = moment >= corners[-1]
        return ExecutionResult(ExecutionStatus.SUCCESS if arrived else ExecutionStatus.CANCELED)

    def _moments(self, corners: list[float]) -> Iterator[float]:
        """Seconds since the beginning of a drive, each when it has come, until its end or a stop.

        Args:
            corners: when each corner of the way is passed.
        """
        speed, began, moment = self.clock.speed, self.clock.now, 0.0
        if speed is None:
            for corner in corners:
                if not self.clock.wait(corner - moment):
                    return
                yield (moment := corner)
            return
        while self.clock.wait(min(MOVES_EVERY * speed, corners[-1] - moment)):
            yield (moment := min(self.clock.now - began, corners[-1]))
            if moment >= corners[-1]:
                return


def _pose_at(way: Trajectory, moment: float) -> Pose:
    """Where one is at a moment of a way, between its corners on a straight line."""
    number = min(bisect.bisect_right(way.t_pts, moment), len(way.t_pts) - 1)
    start, end = way.poses[number - 1], way.poses[number]
    begins, ends = way.t_pts[number - 1], way.t_pts[number]
    share = 1.0 if moment >= ends else (moment - begins) / (ends - begins)
    turned = wrap_angle(end.get_yaw() - start.get_yaw())
    return Pose(
        start.x + share * (end.x - start.x),
        start.y + share * (end.y - start.y),
        yaw=start.get_yaw() + share * turned,
    )


def _made(made: T | None) -> T:
    """What pyrobosim has added; None is what it does not take, of which the plan has nothing."""
    assert made is not None, "pyrobosim does not take a part of the plan"
    return made


def _succeed(result: ExecutionResult, kind: str, what: str) -> None:
    """Raise the error for an action that has not succeeded."""
    if result.status == ExecutionStatus.CANCELED:
        raise CancelledError
    if not result.is_success():
        raise RobotError(kind, f"the robot cannot {what}: {result.message}")
