"""Build a world in pyrobosim with a robot that plans paths and drives. This module imports slowly."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import TypeVar

import numpy as np
import shapely
from pyrobosim.core import Entity, ObjectSpawn, Robot, Room
from pyrobosim.core import World as Pyroworld
from pyrobosim.navigation.types import PathExecutor
from pyrobosim.navigation.world_graph import WorldGraphPlanner
from pyrobosim.planning.actions import ExecutionResult, ExecutionStatus
from pyrobosim.utils.graph_types import Node
from pyrobosim.utils.path import Path
from pyrobosim.utils.pose import Pose
from pyrobosim.utils.trajectory import Trajectory, get_constant_speed_trajectory
from shapely.geometry import LineString

from codebotler.core.errors import RobotError
from codebotler.core.world import World
from codebotler.robots.base import CancelledError, Feedback, ignore_feedback
from codebotler.robots.clock import Clock
from codebotler.robots.pyrobosim.floorplan import ROBOT_RADIUS, Floorplan, Table, plan_floor
from codebotler.robots.simulated import FEEDBACK_SECONDS, METRES_PER_SECOND

RADIANS_PER_SECOND = math.pi / 2
STEP_SECONDS = 0.05  # the real time between two positions of a drive
WALL_WIDTH = 0.001  # the wall width in metres for pyrobosim, since the floor plan already subtracts walls
TOLERANCE = 1e-6  # the rounding error in metres that is allowed between a point and an edge
TABLE_ACTIONS = {"pick": "pick up", "place": "place"}  # the skills for which the robot drives to a table
T = TypeVar("T")


class DrivableWorld:
    """A pyrobosim world with tables, and with a robot that can drive.

    Everything is deterministic, since paths are planned on a graph.
    """

    def __init__(self, world: World, clock: Clock) -> None:
        plan = plan_floor(world)
        names = [room.name for room in world.rooms]
        self._motor = Motor(clock)
        self._world = Pyroworld(name="pyrobosim.world", inflation_radius=ROBOT_RADIUS, object_radius=0.0)
        self._floors = self._build(plan)
        self._rooms = dict(zip(names, self._floors, strict=False))  # leaves out a corridor, which has no name
        self._stands = dict(zip(names, plan.stands, strict=False))
        self._tables = {
            name: self._add_table(floor, table)
            for (name, floor), table in zip(self._rooms.items(), plan.tables, strict=True)
            if table is not None
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
        """The room the robot is in, or None if it is between rooms."""
        pose = self.robot.get_pose()
        return next((name for name, floor in self._rooms.items() if floor.is_inside(pose)), None)

    def put_robot(self, room: str) -> None:
        """Put the robot at its stopping position in a room, without a drive."""
        self.robot.set_pose(self._pose(room))

    def drive(self, room: str, feedback: Feedback) -> None:
        """Drive to the robot's stopping position in a room."""
        self._navigate(self._pose(room), feedback, "GoToInvalidLocation", f'drive to "{room}"')

    def approach_table(self, room: str, skill: str, thing: str, feedback: Feedback) -> None:
        """Drive to the table in a room to pick or place a thing."""
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
                width=passage.width,
                wall_width=WALL_WIDTH,
                conn_method="points",
                conn_points=list(passage.line.coords),
            )
            _expect_added(hallway)
        return floors

    def _add_table(self, floor: Room, table: Table) -> ObjectSpawn:
        """Add a table to a floor, and return the surface that objects are placed on."""
        kind = f"table on {floor.name}"
        self._world.get_location_metadata().data[kind] = {
            "footprint": {"type": "box", "dims": list(table.size)},
            "nav_poses": [[x, y, 0.0, angle] for x, y, angle in table.stands],
            "locations": [{"name": "top"}],
        }
        added = _expect_added(self._world.add_location(category=kind, parent=floor, pose=Pose(*table.centre)))
        (top,) = added.children
        return top


class Roadmap(WorldGraphPlanner):
    """A graph planner like pyrobosim's own, except that it tests visibility exactly, not by sampling."""

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
        """Follow a path to its end, or until the clock is stopped."""
        way = get_constant_speed_trajectory(path, METRES_PER_SECOND, RADIANS_PER_SECOND)
        corners = [float(corner) for corner in way.t_pts]
        moment, last, due = -1.0, "", 0.0
        self.following_path = True
        for moment in self._moments(corners):
            pose = _pose_at(way, moment)
            self.robot.set_pose(pose)
            phrase, now = f"at ({pose.x:.1f}, {pose.y:.1f})", time.monotonic()
            is_due = now >= due or moment >= corners[-1] or self.clock.speed is None
            if is_due and phrase != last:
                self.feedback(phrase)
                last, due = phrase, now + FEEDBACK_SECONDS
        self.following_path = False
        arrived = moment >= corners[-1]
        return ExecutionResult(ExecutionStatus.SUCCESS if arrived else ExecutionStatus.CANCELED)

    def _moments(self, corners: list[float]) -> Iterator[float]:
        """Yield the elapsed seconds of a drive repeatedly, until the drive ends or is stopped."""
        speed, began, moment = self.clock.speed, self.clock.now, 0.0
        if speed is None:
            for corner in corners:
                if not self.clock.wait(corner - moment):
                    return
                yield (moment := corner)
            return
        while self.clock.wait(min(STEP_SECONDS * speed, corners[-1] - moment)):
            yield (moment := min(self.clock.now - began, corners[-1]))
            if moment >= corners[-1]:
                return


def _pose_at(way: Trajectory, moment: float) -> Pose:
    """Interpolate the pose at a time, in seconds since the start of a drive."""
    poses = np.array([(pose.x, pose.y, pose.get_yaw()) for pose in way.poses])
    poses[:, 2] = np.unwrap(poses[:, 2])
    x, y, yaw = (float(np.interp(moment, way.t_pts, axis)) for axis in poses.T)
    return Pose(x, y, yaw=yaw)


def _expect_added(part: T | None) -> T:
    assert part is not None, "pyrobosim accepts the floor plan"
    return part
