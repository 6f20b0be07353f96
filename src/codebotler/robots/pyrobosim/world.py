"""Build a world in pyrobosim with a robot that plans paths and drives. This module imports slowly."""

from __future__ import annotations

import math
import time
from typing import TypeVar

import shapely
from pyrobosim.core import Entity, ObjectSpawn, Robot, Room
from pyrobosim.core import World as Pyroworld
from pyrobosim.navigation.types import PathExecutor
from pyrobosim.navigation.world_graph import WorldGraphPlanner
from pyrobosim.planning.actions import ExecutionResult, ExecutionStatus
from pyrobosim.utils.graph_types import Node
from pyrobosim.utils.path import Path
from pyrobosim.utils.pose import Pose
from pyrobosim.utils.trajectory import get_constant_speed_trajectory, interpolate_trajectory
from shapely.geometry import LineString

from codebotler.core.errors import RobotError
from codebotler.core.world import World
from codebotler.robots.base import CancelledError, Feedback, ignore_feedback
from codebotler.robots.clock import Clock
from codebotler.robots.pyrobosim.floorplan import (
    PASSAGE_WIDTH,
    ROBOT_RADIUS,
    TABLE_SIDE,
    TABLE_STANDS,
    XY,
    Floorplan,
    plan_floor,
)
from codebotler.robots.simulated import FEEDBACK_SECONDS, METRES_PER_SECOND

RADIANS_PER_SECOND = math.pi / 2
STEP_SECONDS = 0.05  # the real time between two positions of a drive
WALL_WIDTH = 0.001  # the wall width in metres for pyrobosim, since the floor plan already subtracts walls
TOLERANCE = 1e-6  # the rounding error in metres that is allowed between a point and an edge
TABLE_ACTIONS = {"pick": "pick up", "place": "place"}  # the skills for which the robot drives to a table
T = TypeVar("T")


class DrivableWorld:
    """A pyrobosim world with tables, in which the robot always takes the same path for the same drive."""

    def __init__(self, world: World, clock: Clock) -> None:
        plan = plan_floor(world)
        names = [room.name for room in world.rooms]
        self._motor = Motor(clock)
        self._world = Pyroworld(name="pyrobosim.world", inflation_radius=ROBOT_RADIUS, object_radius=0.0)
        self._floors = self._build(plan)
        self._rooms = dict(zip(names, self._floors, strict=False))  # leaves out a corridor, which has no name
        self._stands = dict(zip(names, plan.stands, strict=False))
        self._tables = {
            name: self._add_table(floor, centre)
            for (name, floor), centre in zip(self._rooms.items(), plan.tables, strict=True)
            if centre is not None
        }
        for number, floor in enumerate(self._floors):
            places = [*plan.stands[number].coords, *plan.corners(number)]
            floor.nav_poses = [Pose(x, y) for x, y in places]
        self.robot = Robot(name="pyrobosim.robot", radius=ROBOT_RADIUS, start_sensor_threads=False)
        self.robot.set_path_executor(self._motor)
        self._world.add_robot(self.robot, loc=self._rooms[world.robot], pose=self._pose(world.robot))
        self.robot.set_path_planner(Roadmap())

    @property
    def room(self) -> str | None:
        """The name of the room that the robot is in, or None if the robot is between rooms."""
        pose = self.robot.get_pose()
        return next((name for name, floor in self._rooms.items() if floor.is_inside(pose)), None)

    def put_robot(self, room: str) -> None:
        """Put the robot at its stopping position in a room without driving there."""
        self.robot.set_pose(self._pose(room))

    def drive(self, room: str, feedback: Feedback) -> None:
        """Drive to a room's stopping position. Raise CancelledError if stopped, RobotError if impossible."""
        self._navigate(self._pose(room), feedback, "GoToInvalidLocation", f'drive to "{room}"')

    def approach_table(self, room: str, skill: str, thing: str, feedback: Feedback) -> None:
        """Drive to the table in a room to pick or place a thing. Raise RobotError if this is impossible."""
        kind, action = f"{skill.capitalize()}Failed", f'{TABLE_ACTIONS[skill]} "{thing}"'
        table = self._tables.get(room)
        if table is None:
            raise RobotError(kind, f'the robot cannot {action}: no table fits into "{room}"')
        self._navigate(table, feedback, kind, action)

    def _navigate(self, goal: Pose | Entity, feedback: Feedback, kind: str, action: str) -> None:
        """Drive to a goal. Raise CancelledError if the drive was stopped, and RobotError if it failed."""
        self._motor.feedback = feedback
        result = self.robot.navigate(goal=goal)
        if result.status == ExecutionStatus.CANCELED:
            raise CancelledError
        if not result.is_success():
            raise RobotError(kind, f"the robot cannot {action}: {result.message}")

    def _pose(self, room: str) -> Pose:
        return Pose(self._stands[room].x, self._stands[room].y)

    def _build(self, plan: Floorplan) -> list[Room]:
        """Add all floors and passages to the pyrobosim world, and return the floors."""
        floors = []
        for number, floor in enumerate(plan.floors):
            corners = list(floor.exterior.coords)
            added = self._world.add_room(name=f"floor{number}", footprint=corners, wall_width=WALL_WIDTH)
            floors.append(_expect_added(added))
        for passage in plan.passages:
            start, end = (floors[number] for number in passage.ends)
            hallway = self._world.add_hallway(
                room_start=start,
                room_end=end,
                width=PASSAGE_WIDTH,
                wall_width=WALL_WIDTH,
                conn_method="points",
                conn_points=list(passage.line.coords),
            )
            _expect_added(hallway)
        return floors

    def _add_table(self, floor: Room, centre: XY) -> ObjectSpawn:
        """Add a table to a floor, and return the surface that objects are placed on."""
        kind = f"table on {floor.name}"
        self._world.get_location_metadata().data[kind] = {
            "footprint": {"type": "box", "dims": [TABLE_SIDE, TABLE_SIDE]},
            "nav_poses": [[x, y, 0.0, angle] for x, y, angle in TABLE_STANDS],
            "locations": [{"name": "top"}],
        }
        added = _expect_added(self._world.add_location(category=kind, parent=floor, pose=Pose(*centre)))
        (top,) = added.children
        return top


class Roadmap(WorldGraphPlanner):
    """A path planner like pyrobosim's, except that it tests exactly whether a straight line is free."""

    plugin_name = "codebotler"

    def reset(self) -> None:
        """Rebuild the graph from the current world."""
        world = self.robot and self.robot.world
        if world is not None:
            self._space = world.total_internal_polygon.buffer(TOLERANCE)
            shapely.prepare(self._space)
        super().reset()

    def connect_neighbors(self, node: Node) -> None:
        """Connect a node with all nodes that are visible from it."""
        start = (node.pose.x, node.pose.y)
        for other in self.graph.nodes:
            if other is not node and self._space.covers(LineString([start, (other.pose.x, other.pose.y)])):
                self.graph.add_edge(node, other)


class Motor(PathExecutor):
    """Moves the robot along a path at the pace of a clock, until the clock is stopped.

    pyrobosim's own executor reacts to a cancel with a delay, and ignores a cancel that comes too early.
    """

    def __init__(self, clock: Clock) -> None:
        super().__init__()
        self.clock = clock
        self.feedback: Feedback = ignore_feedback

    def execute(self, path: Path, *_: float, **__: float) -> ExecutionResult:
        """Follow a path, and return SUCCESS at its end, or CANCELED if the clock is stopped."""
        speed, began = self.clock.speed, self.clock.now
        way = get_constant_speed_trajectory(path, METRES_PER_SECOND, RADIANS_PER_SECOND)
        if speed is not None:
            way = interpolate_trajectory(way, max(STEP_SECONDS * speed, 0.01))
        last, due, arrived = "", 0.0, False
        self.following_path = True
        for moment, pose in zip(map(float, way.t_pts), way.poses, strict=True):
            if not self.clock.wait(max(0.0, began + moment - self.clock.now)):
                break
            self.robot.set_pose(pose)
            arrived = pose is way.poses[-1]
            phrase, now = f"at ({pose.x:.1f}, {pose.y:.1f})", time.monotonic()
            if phrase != last and (arrived or now >= due or speed is None):
                self.feedback(phrase)
                last, due = phrase, now + FEEDBACK_SECONDS
        self.following_path = False
        return ExecutionResult(ExecutionStatus.SUCCESS if arrived else ExecutionStatus.CANCELED)


def _expect_added(part: T | None) -> T:
    assert part is not None, "pyrobosim rejected a part of the floor plan"
    return part
