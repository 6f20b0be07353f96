"""A stand-in for a robot with move_base: `python3 move_base_robot.py [OPTIONS]`.

In addition to move_base, amcl and odometry, it offers the topic /speech and the service /door/open. It
prints events as JSON lists, one a line, and ends with its input.

move_base and amcl of ROS 1, as documented:
- /move_base is an action server for one goal at a time: a new goal preempts the older one, and the robot
  drives on without a stop.
- A cancelled goal is preempted in the next round of the controller, which then asks for the velocity 0; the
  robot still brakes.
- A goal without a plan is aborted with a string after the recoveries, one with an invalid quaternion at once.
- The result is empty, and the feedback is the robot's position.
- amcl publishes its pose, latched, after 0.2 m or 30 degrees, and the transform from map to odom.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import threading
import time
from typing import Any

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback
from nav_msgs.msg import Odometry
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage

ROUND = 0.05  # Seconds between rounds of the controller.
MAP = 10.0  # Metres from the centre of the map to its sides.
NEAR, TURNED = 0.2, math.pi / 6  # Metres and radians between poses of amcl; goals are reached within NEAR.


def numbers(text: str) -> list[float]:
    return [float(number) for number in text.split(",")]


def tell(*what: object) -> None:
    print(json.dumps(what), flush=True)


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--start", type=numbers, default=[0.0, 0.0, 0.0], help="x,y,yaw")
    parser.add_argument("--speed", type=float, default=0.5, help="metres a second")
    parser.add_argument("--acceleration", type=float, default=1.0, help="also to brake")
    parser.add_argument("--never-stops", action="store_true", help="cancelled goals end, but it drives on")
    parser.add_argument("--door-jams", action="store_true")
    parser.add_argument("--door-breaks", action="store_true", help="its service fails")
    parser.add_argument("--door-dies", action="store_true", help="the robot dies with its service")
    return parser.parse_args()


class Body:
    """The robot's position, and its motion towards a goal."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options, self.start = options, options.start
        self.x, self.y, self.yaw = options.start
        self.speed = 0.0
        self.goal: tuple[float, float, float] | None = None
        self.published = (math.inf, 0.0, 0.0)
        self.amcl = rospy.Publisher("/amcl_pose", PoseWithCovarianceStamped, queue_size=2, latch=True)
        self.odom = rospy.Publisher("/odom", Odometry, queue_size=2)
        self.tf = rospy.Publisher("/tf", TFMessage, queue_size=2)
        threading.Thread(target=self.live, daemon=True).start()

    def is_there(self) -> bool:
        return self.goal is None or math.dist(self.goal[:2], (self.x, self.y)) < NEAR

    def live(self) -> None:
        while True:
            self.move()
            self.publish()
            time.sleep(ROUND)

    def move(self) -> None:
        goal, step = self.goal, self.options.acceleration * ROUND
        wanted = 0.0
        if goal is not None and not self.is_there():
            self.yaw = math.atan2(goal[1] - self.y, goal[0] - self.x)
            wanted = self.options.speed
        elif goal is not None:
            self.yaw, self.speed = goal[2], 0.0
        self.speed += max(-step, min(step, wanted - self.speed))
        self.x += self.speed * ROUND * math.cos(self.yaw)
        self.y += self.speed * ROUND * math.sin(self.yaw)

    def publish(self) -> None:
        here = self.x, self.y, self.yaw
        last = self.published
        if math.dist(last[:2], here[:2]) >= NEAR or abs(last[2] - here[2]) >= TURNED:
            self.published = here
            pose = PoseWithCovarianceStamped()
            fill(pose, "map", pose.pose.pose, here)
            self.amcl.publish(pose)
        odometry = Odometry(child_frame_id="base_link")
        begun_x, begun_y, begun_yaw = self.start
        away, side = here[0] - begun_x, here[1] - begun_y
        cosine, sine = math.cos(-begun_yaw), math.sin(-begun_yaw)
        moved = (cosine * away - sine * side, sine * away + cosine * side, here[2] - begun_yaw)
        fill(odometry, "odom", odometry.pose.pose, moved)
        odometry.twist.twist.linear.x = self.speed
        self.odom.publish(odometry)
        self.tf.publish([transform("map", "odom", self.start), transform("odom", "base_link", moved)])


def fill(message: Any, frame: str, pose: Any, place: tuple[float, ...]) -> None:
    message.header.frame_id, message.header.stamp = frame, rospy.Time.now()
    pose.position.x, pose.position.y, yaw = place
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)


def transform(parent: str, child: str, place: tuple[float, ...]) -> TransformStamped:
    made, pose = TransformStamped(child_frame_id=child), PoseStamped()
    fill(pose, parent, pose.pose, place)
    made.header, made.transform.rotation = pose.header, pose.pose.orientation
    made.transform.translation.x, made.transform.translation.y, _ = place
    return made


class MoveBase:
    """The action server."""

    def __init__(self, body: Body) -> None:
        self.body = body
        self.server = actionlib.SimpleActionServer(
            "/move_base", MoveBaseAction, self.execute, auto_start=False
        )
        self.server.start()

    def execute(self, goal: Any) -> None:
        while goal is not None:
            goal = self.drive(goal.target_pose)

    def drive(self, target: Any) -> Any:
        """Drive to a target; return the next goal if it arrives first."""
        x, y, turn = target.pose.position.x, target.pose.position.y, target.pose.orientation
        if abs(math.hypot(turn.x, turn.y, turn.z, turn.w) - 1) > 0.01:
            return self.server.set_aborted(text="the quaternion is invalid")
        yaw = 2 * math.atan2(turn.z, turn.w)
        tell("goal", round(x, 2), round(y, 2), round(yaw, 2), target.header.frame_id)
        if target.header.frame_id != "map" or max(abs(x), abs(y)) > MAP:
            rospy.sleep(0.3)  # Recoveries take time.
            return self.server.set_aborted(text="there is no plan, nor after recoveries")
        self.body.goal = (x, y, yaw)
        while not self.body.is_there():
            if self.server.is_preempt_requested():
                if self.server.is_new_goal_available():
                    return self.server.accept_new_goal()
                tell("cancel")
                if not self.body.options.never_stops:
                    self.body.goal = None
                return self.server.set_preempted()
            feedback = MoveBaseFeedback()
            fill(feedback.base_position, "map", feedback.base_position.pose, (self.body.x, self.body.y, 0.0))
            self.server.publish_feedback(feedback)
            rospy.sleep(ROUND)
        return self.server.set_succeeded(text="it is there")


def main() -> None:
    parsed = options()
    rospy.init_node("move_base_robot", disable_signals=True, log_level=rospy.FATAL)

    def open_door(_: Any) -> TriggerResponse:
        tell("door")
        if parsed.door_dies:
            os._exit(1)
        if parsed.door_breaks:
            raise RuntimeError("no current")
        return TriggerResponse(not parsed.door_jams, "the door is jammed" if parsed.door_jams else "")

    MoveBase(Body(parsed))
    rospy.Subscriber("/speech", String, lambda message: tell("heard", message.data))
    rospy.Service("/door/open", Trigger, open_door)
    tell("ready")
    sys.stdin.read()
    os._exit(0)


main()
