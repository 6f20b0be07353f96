"""A client of Nav2 in plain rclpy, which reads commands and prints events, both as JSON lists."""

from __future__ import annotations

import json
import math
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, sys.argv[1])

import rclpy
import rclpy.action
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String
from std_srvs.srv import Trigger

from message_types import as_data
from ros2_types import message_types

HERE = Path(__file__).parent
NAVIGATE, FILTER = "nav2_msgs/action/NavigateToPose", "nav2_msgs/msg/CostmapFilterInfo"
FRAMES = "tf2_msgs/msg/TFMessage"
TYPES = message_types([NAVIGATE, FILTER, FRAMES], [HERE / "nav2_msgs", HERE / "tf2_msgs"])
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def tell(*what: object) -> None:
    print(json.dumps(what), flush=True)


class Client:
    def __init__(self, node: Any) -> None:
        self.node = node
        self.handles: dict[str, Any] = {}
        self.feedback: list[Any] = []
        self.speeds: list[tuple[float, float]] = []
        self.poses: list[tuple[float, float]] = []
        self.frames: list[Any] = []
        self.navigate = rclpy.action.ActionClient(node, TYPES[NAVIGATE], "/navigate_to_pose")
        self.speech = node.create_publisher(String, "/speech", 10)
        self.masks = node.create_publisher(OccupancyGrid, "/keepout_mask", LATCHED)
        self.filters = node.create_publisher(TYPES[FILTER], "/costmap_filter_info", LATCHED)
        self.door = node.create_client(Trigger, "/door/open")
        node.create_subscription(PoseWithCovarianceStamped, "/amcl_pose", self.hear_pose, LATCHED)
        node.create_subscription(Odometry, "/odom", self.hear_odometry, 10)
        node.create_subscription(TYPES[FRAMES], "/tf", lambda data: self.frames.append(data.transforms), 100)

    def hear_pose(self, pose: Any) -> None:
        self.poses.append((pose.pose.pose.position.x, pose.pose.pose.position.y))

    def hear_odometry(self, odometry: Any) -> None:
        linear = odometry.twist.twist.linear
        self.speeds.append((time.monotonic(), math.hypot(linear.x, linear.y)))

    def obey(self, what: str, *more: Any) -> None:
        getattr(self, what)(*more)

    def send(self, name: str, x: float, y: float, *more: Any) -> None:
        given: tuple[Any, ...] = more + (0.0, "map", "")[len(more) :]
        yaw, frame, tree = given
        goal = TYPES[NAVIGATE].Goal(pose=PoseStamped(), behavior_tree=tree)
        goal.pose.header.frame_id = frame
        goal.pose.pose.position.x, goal.pose.pose.position.y = float(x), float(y)
        goal.pose.pose.orientation.z, goal.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        sent = self.navigate.send_goal_async(goal, lambda data: self.feedback.append(data.feedback))
        sent.add_done_callback(lambda done: self.on_sent(name, done.result()))

    def on_sent(self, name: str, handle: Any) -> None:
        tell("accepted" if handle.accepted else "rejected", name)
        self.handles[name] = handle
        if handle.accepted:
            handle.get_result_async().add_done_callback(lambda done: self.on_ended(name, done.result()))

    def on_ended(self, name: str, answer: Any) -> None:
        result = answer.result
        speed = self.speeds[-1][1] if self.speeds else 0.0
        tell("result", name, answer.status, result.error_code, result.error_msg, speed, time.monotonic())

    def cancel(self, name: str) -> None:
        asked = time.monotonic()
        self.handles[name].cancel_goal_async().add_done_callback(
            lambda done: tell("cancelling", len(done.result().goals_canceling), asked)
        )

    def mask(self, left: float, bottom: float, right: float, top: float) -> None:
        """Forbid a rectangle on a grid of 0.1 m from -5 to 5."""
        grid = OccupancyGrid()
        grid.header.frame_id = "map"
        grid.info.resolution, grid.info.width, grid.info.height = 0.1, 100, 100
        grid.info.origin.position.x = grid.info.origin.position.y = -5.0
        centres = [-4.95 + 0.1 * number for number in range(100)]
        grid.data = [100 * (left <= x <= right and bottom <= y <= top) for y in centres for x in centres]
        self.masks.publish(grid)
        self.filters.publish(
            TYPES[FILTER](type=0, filter_mask_topic="/keepout_mask", base=0.0, multiplier=1.0)
        )

    def say(self, text: str) -> None:
        self.speech.publish(String(data=text))

    def open(self) -> None:
        self.door.call_async(Trigger.Request()).add_done_callback(
            lambda done: tell("door", done.result().success, done.result().message)
        )

    def look(self) -> None:
        """Print all messages since the last look."""
        feedback = [as_data(each) for each in self.feedback]
        frames = [as_data(each) for each in self.frames[-1]] if self.frames else []
        tell("seen", {"feedback": feedback, "speeds": self.speeds, "poses": self.poses, "frames": frames})
        self.feedback, self.speeds, self.poses = [], [], []


rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node("client")
client = Client(node)
executor = SingleThreadedExecutor()
executor.add_node(node)
threading.Thread(target=executor.spin, daemon=True).start()
client.navigate.wait_for_server()
client.door.wait_for_service()
while client.speech.get_subscription_count() == 0 or not client.speeds:
    time.sleep(0.01)
tell("ready")
for line in sys.stdin:
    executor.create_task(client.obey, *json.loads(line))
os._exit(0)
