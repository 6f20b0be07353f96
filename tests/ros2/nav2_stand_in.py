"""A stand-in for a robot with Nav2, written from Nav2's documentation: `python nav2_stand_in.py WORKERS`.

It offers /navigate_to_pose and, in addition to Nav2, the topic /speech and the service /door/open. The robot
drives straight where it can, else around obstacles and keepout zones, at a limited speed and acceleration.

It prints events as JSON lists, one a line. Lines on standard input change the robot: activate, deactivate,
block (it cannot move), unblock, die. It ends with its input.

Nav2 of ROS 2 Kilted, as documented:
- A goal that arrives during another preempts it: the older one is aborted with an empty result, and the
  robot does not stop. A preempting goal that asks for another behavior tree is aborted instead.
- The loop of the behavior tree takes 10 ms; each round looks for cancels, and publishes feedback.
- A cancelled goal ends at the next round, while the robot still brakes: controllers may cancel gracefully.
- While the server is inactive, goals are rejected, and the current one is aborted.
- The result has the lowest error code, of the controller (1xx) or planner (2xx), and its message. Recoveries
  are tried only where they may help: if no way was found, or if the robot makes no progress.
- The goal checker accepts 0.25 m and 0.25 rad from the goal.
- AMCL publishes its pose, transient local, after 0.25 m or 0.2 rad.
- Keepout filter: /costmap_filter_info names the topic of a mask; base + multiplier * value of 100 or more is
  forbidden.
"""

from __future__ import annotations

import argparse
import heapq
import json
import math
import os
import signal
import sys
import threading
import time
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

sys.path.insert(0, sys.argv[1])

import rclpy
import rclpy.action
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.action import CancelResponse, GoalResponse
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ros2_types import message_types

LOOP = 0.01  # Seconds between rounds of the behavior tree.
REPLANS = 1.0  # Seconds between two plans of a drive.
PROGRESS = 0.5  # Metres that the robot must move within --patience.
TOLERANCE = 0.25  # Metres and radians from the goal.
CELL = 0.2  # Metres between cells of the planner's grid.
LETHAL = 100.0  # This value of a filter's mask forbids a cell.
TURNS = 1.5  # Radians a second.
GOAL_OUTSIDE_MAP, START_OCCUPIED, GOAL_OCCUPIED, NO_VALID_PATH = 204, 205, 206, 208
FAILED_TO_MAKE_PROGRESS = 105
FAILED_TO_LOAD_BEHAVIOR_TREE, TF_ERROR = 9001, 9002

Point = tuple[float, float]


def numbers(text: str) -> tuple[float, ...]:
    return tuple(float(number) for number in text.split(","))


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("workers", help="the folder with ros2_types.py, which builds nav2_msgs")
    parser.add_argument(
        "--map", type=numbers, default=(-10.0, -10.0, 10.0, 10.0), help="left,bottom,right,top"
    )
    parser.add_argument("--obstacle", type=numbers, action="append", default=[])
    parser.add_argument("--start", type=numbers, default=(0.0, 0.0, 0.0), help="x,y,yaw")
    parser.add_argument("--speed", type=float, default=0.5, help="metres a second")
    parser.add_argument(
        "--acceleration", type=float, default=1.0, help="metres a second squared, also to brake"
    )
    parser.add_argument("--recoveries", type=int, default=6, help="tries before a goal is given up")
    parser.add_argument("--recovery-seconds", type=float, default=0.1)
    parser.add_argument(
        "--patience", type=float, default=1.0, help="seconds without progress before a recovery"
    )
    parser.add_argument("--inactive", action="store_true", help="start inactive")
    parser.add_argument(
        "--slow-cancel", type=float, default=0.0, help="seconds that it drives on after a cancel"
    )
    parser.add_argument("--refuse-cancel", action="store_true")
    parser.add_argument("--never-stops", action="store_true", help="cancelled goals end, but it drives on")
    parser.add_argument("--door-jams", action="store_true")
    return parser.parse_args()


def tell(*what: object) -> None:
    print(json.dumps(what), flush=True)


class NavigationError(Exception):
    def __init__(self, code: int, text: str, *, can_recover: bool = False) -> None:
        super().__init__(text)
        self.code, self.text, self.can_recover = code, text, can_recover


@dataclass
class Floor:
    """The space that the robot may use."""

    bounds: tuple[float, ...]
    obstacles: list[tuple[float, ...]]
    mask: Any = None  # nav_msgs/OccupancyGrid
    filter: Any = None  # nav2_msgs/CostmapFilterInfo

    def is_inside(self, point: Point) -> bool:
        return _holds(self.bounds, point)

    def is_free(self, point: Point) -> bool:
        blocked = any(_holds(obstacle, point) for obstacle in self.obstacles)
        return self.is_inside(point) and not blocked and not self._is_kept_out(point)

    def _is_kept_out(self, point: Point) -> bool:
        if self.mask is None or self.filter is None:
            return False
        info = self.mask.info
        column = math.floor((point[0] - info.origin.position.x) / info.resolution)
        row = math.floor((point[1] - info.origin.position.y) / info.resolution)
        if not (0 <= column < info.width and 0 <= row < info.height):
            return False
        value = self.mask.data[row * info.width + column]
        return bool(value != -1 and self.filter.base + self.filter.multiplier * value >= LETHAL)

    def is_clear(self, start: Point, end: Point) -> bool:
        steps = max(1, math.ceil(math.dist(start, end) / (CELL / 4)))
        return all(self.is_free(_between(start, end, step / steps)) for step in range(1, steps + 1))

    def plan(self, start: Point, goal: Point) -> list[Point]:
        """Return the corners of a way; raise the planner server's error if there is none."""
        if not self.is_inside(goal):
            raise NavigationError(GOAL_OUTSIDE_MAP, f"goal {goal} is outside of the map")
        if not self.is_free(goal):
            raise NavigationError(GOAL_OCCUPIED, f"goal {goal} is in an obstacle")
        if not self.is_free(start):
            raise NavigationError(START_OCCUPIED, f"start {start} is in an obstacle")
        if self.is_clear(start, goal):
            return [goal]
        way = [start, *reversed(self._search(goal, start)), goal]
        corners = []
        while len(way) > 1:  # Cut corners where the way is clear.
            ahead = next(n for n in range(len(way) - 1, 0, -1) if n == 1 or self.is_clear(way[0], way[n]))
            way = way[ahead:]
            corners.append(way[0])
        return corners

    def _search(self, start: Point, goal: Point) -> list[Point]:
        """Search the grid with A*."""
        first, last = _cell(start), _cell(goal)
        came: dict[tuple[int, int], tuple[int, int]] = {first: first}
        cost = {first: 0.0}
        queue = [(0.0, first)]
        while queue:
            _, cell = heapq.heappop(queue)
            if cell == last:
                way = [cell]
                while came[way[-1]] != way[-1]:
                    way.append(came[way[-1]])
                return [_centre(each) for each in reversed(way[1:-1])]
            for step in ((x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y):
                near = (cell[0] + step[0], cell[1] + step[1])
                far = cost[cell] + math.hypot(*step)
                if far < cost.get(near, math.inf) and self.is_clear(_centre(cell), _centre(near)):
                    cost[near], came[near] = far, cell
                    heapq.heappush(queue, (far + math.dist(near, last), near))
        raise NavigationError(NO_VALID_PATH, f"no way between {goal} and {start}", can_recover=True)


def _holds(area: tuple[float, ...], point: Point) -> bool:
    return area[0] <= point[0] <= area[2] and area[1] <= point[1] <= area[3]


def _between(start: Point, end: Point, share: float) -> Point:
    return start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share


def _cell(point: Point) -> tuple[int, int]:
    return round(point[0] / CELL), round(point[1] / CELL)


def _centre(cell: tuple[int, int]) -> Point:
    return cell[0] * CELL, cell[1] * CELL


def _normalize(angle: float) -> float:
    return math.remainder(angle, math.tau)


@dataclass
class Body:
    """The robot's body: it follows corners in any direction and then turns; without corners it brakes."""

    x: float
    y: float
    yaw: float
    speed_limit: float
    acceleration: float
    speed: float = 0.0
    heading: float = 0.0
    turning: float = 0.0
    is_blocked: bool = False
    corners: list[Point] = field(default_factory=list)
    yaw_at_end: float | None = None

    def at(self) -> Point:
        return self.x, self.y

    def left(self) -> float:
        way = [self.at(), *self.corners]
        return math.fsum(math.dist(*pair) for pair in pairwise(way))

    def stop(self) -> None:
        self.corners, self.yaw_at_end = [], None

    def move(self, seconds: float) -> None:
        self.turning = 0.0
        if self.is_blocked:
            self.speed = 0.0
            return
        wanted = (
            min(self.speed_limit, math.sqrt(2 * self.acceleration * self.left())) if self.corners else 0.0
        )
        change = self.acceleration * seconds
        self.speed = min(max(wanted, self.speed - change), self.speed + change)
        if self.corners:
            ahead = self.corners[0]
            self.heading = math.atan2(ahead[1] - self.y, ahead[0] - self.x)
            self._turn_to(self.heading, seconds)
            if math.dist(self.at(), ahead) <= self.speed * seconds:
                self.x, self.y = self.corners.pop(0)
                return
        elif self.yaw_at_end is not None:
            self._turn_to(self.yaw_at_end, seconds)
        self.x += self.speed * seconds * math.cos(self.heading)
        self.y += self.speed * seconds * math.sin(self.heading)

    def _turn_to(self, yaw: float, seconds: float) -> None:
        rest = _normalize(yaw - self.yaw)
        self.turning = math.copysign(min(TURNS, abs(rest) / seconds), rest)
        self.yaw = _normalize(self.yaw + self.turning * seconds)


OPTIONS = options()
HERE = Path(__file__).parent
NAVIGATE, FILTER = "nav2_msgs/action/NavigateToPose", "nav2_msgs/msg/CostmapFilterInfo"
FRAMES = "tf2_msgs/msg/TFMessage"
TYPES = message_types([NAVIGATE, FILTER, FRAMES], [HERE / "nav2_msgs", HERE / "tf2_msgs"])
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Drive:
    """The state of the behavior tree for one goal."""

    def __init__(self, handle: Any) -> None:
        pose = handle.request.pose.pose
        self.handle, self.frame = handle, handle.request.pose.header.frame_id
        self.goal = (pose.position.x, pose.position.y)
        self.yaw = 2 * math.atan2(pose.orientation.z, pose.orientation.w)
        self.tree = handle.request.behavior_tree
        self.end = Future(executor=executor)
        self.begun = time.monotonic()
        self.recoveries = 0
        self.planned = self.recovers_until = 0.0
        self.cancelled: float | None = None
        self.progress: tuple[float, Point] = (self.begun, (math.inf, math.inf))

    def finish(self, how: str, code: int = 0, text: str = "") -> None:
        """End the goal; how is succeed, abort or canceled."""
        tell("ended", how, code, text)
        self.end.set_result((how, code, text))


class Robot:
    def __init__(self, node: Any) -> None:
        x, y, yaw = OPTIONS.start
        self.node, self.start = node, (x, y, yaw)
        self.floor = Floor(OPTIONS.map, OPTIONS.obstacle)
        self.body = Body(x, y, yaw, OPTIONS.speed, OPTIONS.acceleration)
        self.is_active = not OPTIONS.inactive
        self.current: Drive | None = None
        self.pending: Drive | None = None
        self.drives: dict[bytes, Drive] = {}
        self.localized: tuple[float, float, float] | None = None
        self.moved = time.monotonic()
        self.poses = node.create_publisher(PoseWithCovarianceStamped, "/amcl_pose", LATCHED)
        self.odometry = node.create_publisher(Odometry, "/odom", 10)
        self.frames = node.create_publisher(TYPES[FRAMES], "/tf", 100)
        node.create_subscription(TYPES[FILTER], "/costmap_filter_info", self.take_filter, LATCHED)
        node.create_subscription(String, "/speech", lambda speech: tell("heard", speech.data), 10)
        node.create_service(Trigger, "/door/open", self.open_door)
        node.create_timer(LOOP, self.tick)
        node.create_timer(0.05, self.publish)
        self.server = rclpy.action.ActionServer(
            node,
            TYPES[NAVIGATE],
            "/navigate_to_pose",
            self.execute,
            goal_callback=self.accept,
            handle_accepted_callback=self.take,
            cancel_callback=self.take_cancel,
        )

    def accept(self, _: Any) -> GoalResponse:
        if not self.is_active:
            tell("rejected")
        return GoalResponse.ACCEPT if self.is_active else GoalResponse.REJECT

    def take(self, handle: Any) -> None:
        drive = Drive(handle)
        self.drives[bytes(handle.goal_id.uuid)] = drive
        tell("goal", *(round(number, 3) for number in (*drive.goal, drive.yaw)))
        if self.pending is not None:
            self.pending.finish("abort")
        self.pending = drive
        handle.execute()

    def take_cancel(self, handle: Any) -> CancelResponse:
        tell("cancel")
        refuses = OPTIONS.refuse_cancel or not handle.is_active
        return CancelResponse.REJECT if refuses else CancelResponse.ACCEPT

    async def execute(self, handle: Any) -> Any:
        how, code, text = await self.drives.pop(bytes(handle.goal_id.uuid)).end
        if how == "canceled" and not handle.is_cancel_requested:
            how = "abort"
        getattr(handle, how)()
        return TYPES[NAVIGATE].Result(error_code=code, error_msg=text)

    def tick(self) -> None:
        """Run one round of the behavior tree and of the body."""
        now = time.monotonic()
        if self.pending is not None:
            drive, self.pending = self.pending, None
            self.begin(drive)
        if self.current is not None:
            self.go_on(self.current, now)
        self.body.move(now - self.moved)
        self.moved = now

    def begin(self, drive: Drive) -> None:
        """Start a goal, or have it preempt the current one."""
        if drive.tree and self.current is not None:
            drive.finish("abort")
        elif drive.tree:
            drive.finish("abort", FAILED_TO_LOAD_BEHAVIOR_TREE, f"there is no behavior tree {drive.tree}")
        elif drive.frame != "map":
            drive.finish("abort", TF_ERROR, f'no transform from the frame "{drive.frame}" to map')
        else:
            if self.current is not None:
                self.current.finish("abort")
            self.current = drive

    def finish(self, how: str, code: int = 0, text: str = "") -> None:
        assert self.current is not None
        drive, self.current = self.current, None
        if not OPTIONS.never_stops or how != "canceled":
            self.body.stop()
        drive.finish(how, code, text)

    def go_on(self, drive: Drive, now: float) -> None:
        if drive.handle.is_cancel_requested:
            drive.cancelled = drive.cancelled or now
            if now - drive.cancelled >= OPTIONS.slow_cancel:
                self.finish("canceled")
                return
        if not self.is_active:
            self.finish("abort")
            return
        try:
            self.drive(drive, now)
        except NavigationError as failure:
            if not failure.can_recover or drive.recoveries == OPTIONS.recoveries:
                self.finish("abort", failure.code, failure.text)
                return
            drive.recoveries += 1
            drive.recovers_until = now + OPTIONS.recovery_seconds
            drive.planned, drive.progress = 0.0, (drive.recovers_until, self.body.at())
            self.body.stop()
            tell("recovery", drive.recoveries)
        self.give_feedback(drive, now)

    def drive(self, drive: Drive, now: float) -> None:
        if now < drive.recovers_until:
            return
        body = self.body
        near = math.dist(body.at(), drive.goal) < TOLERANCE
        if near and abs(_normalize(drive.yaw - body.yaw)) < TOLERANCE:
            self.finish("succeed")
            return
        if near and not body.corners:
            body.yaw_at_end = drive.yaw
        elif now - drive.planned > REPLANS:
            body.corners, body.yaw_at_end = self.floor.plan(body.at(), drive.goal), drive.yaw
            drive.planned = now
        if near or math.dist(body.at(), drive.progress[1]) > PROGRESS:
            drive.progress = now, body.at()
        elif now - drive.progress[0] > OPTIONS.patience:
            raise NavigationError(FAILED_TO_MAKE_PROGRESS, "the robot makes no progress", can_recover=True)

    def give_feedback(self, drive: Drive, now: float) -> None:
        if self.current is not drive:
            return
        left, speed = self.body.left(), self.body.speed
        remaining = left / speed if speed > 0.01 and left > 0.1 else 0.0
        feedback = TYPES[NAVIGATE].Feedback(
            navigation_time=Duration(seconds=now - drive.begun).to_msg(),
            estimated_time_remaining=Duration(seconds=remaining).to_msg(),
            number_of_recoveries=drive.recoveries,
            distance_remaining=left,
        )
        feedback.current_pose.header = self.stamp(PoseStamped(), "map").header
        self.put(feedback.current_pose.pose, self.body.x, self.body.y, self.body.yaw)
        drive.handle.publish_feedback(feedback)

    def stamp(self, message: Any, frame: str) -> Any:
        message.header.frame_id, message.header.stamp = frame, self.node.get_clock().now().to_msg()
        return message

    def put(self, pose: Any, x: float, y: float, yaw: float) -> None:
        pose.position.x, pose.position.y = x, y
        pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)

    def publish(self) -> None:
        """Publish odometry, which starts at zero, and frames; also the pose after enough motion."""
        x, y, yaw = self.start
        dx, dy, body = self.body.x - x, self.body.y - y, self.body
        dx, dy = dx * math.cos(yaw) + dy * math.sin(yaw), dy * math.cos(yaw) - dx * math.sin(yaw)
        odometry = self.stamp(Odometry(child_frame_id="base_link"), "odom")
        self.put(odometry.pose.pose, dx, dy, _normalize(body.yaw - yaw))
        twist, ahead = odometry.twist.twist, body.heading - body.yaw
        twist.linear.x, twist.linear.y = body.speed * math.cos(ahead), body.speed * math.sin(ahead)
        twist.angular.z = body.turning
        self.odometry.publish(odometry)
        frames = [
            self.frame("map", "odom", *self.start),
            self.frame("odom", "base_link", dx, dy, body.yaw - yaw),
        ]
        self.frames.publish(TYPES[FRAMES](transforms=frames))
        last = self.localized
        if last is None or math.dist(body.at(), last[:2]) > 0.25 or abs(_normalize(body.yaw - last[2])) > 0.2:
            self.localized = body.x, body.y, body.yaw
            pose = self.stamp(PoseWithCovarianceStamped(), "map")
            self.put(pose.pose.pose, *self.localized)
            self.poses.publish(pose)

    def frame(self, parent: str, child: str, x: float, y: float, yaw: float) -> Any:
        frame = self.stamp(TransformStamped(child_frame_id=child), parent)
        frame.transform.translation.x, frame.transform.translation.y = x, y
        frame.transform.rotation.z, frame.transform.rotation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        return frame

    def take_filter(self, info: Any) -> None:
        if info.type == 0:
            self.floor.filter = info
            self.masks = self.node.create_subscription(
                OccupancyGrid, info.filter_mask_topic, self.take_mask, LATCHED
            )

    def take_mask(self, mask: Any) -> None:
        self.floor.mask = mask
        tell("mask", mask.info.width, mask.info.height, sum(value > 0 for value in mask.data))

    def open_door(self, _: Any, response: Any) -> Any:
        tell("door")
        response.success = not OPTIONS.door_jams
        response.message = "the door jams" if OPTIONS.door_jams else "the door is open"
        return response

    def obey(self, word: str) -> None:
        if word in {"activate", "deactivate"}:
            self.is_active = word == "activate"
        elif word in {"block", "unblock"}:
            self.body.is_blocked = word == "block"
        elif word == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        tell(word)


rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node("bt_navigator")
executor = SingleThreadedExecutor()
robot = Robot(node)
executor.add_node(node)
threading.Thread(target=executor.spin, daemon=True).start()
tell("ready")
for line in sys.stdin:
    executor.create_task(robot.obey, line.strip())
os._exit(0)
