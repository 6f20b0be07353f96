"""Where a robot is, and how fast it moves, from messages of ROS as plain data."""

from __future__ import annotations

import cmath
import math
import time
from typing import Any

from channel import Channel, Message

EVERY = 0.05  # seconds between two poses, or velocities, that the tool is told
Turn = tuple[float, float, float]  # x, y and yaw of a frame in another


class MotionReports:
    """Tells the tool a robot's poses and velocities.

    With `frames`, of the map and of the robot, poses come from transforms; otherwise from messages that
    have a pose with a position and an orientation in them, at any depth.
    """

    def __init__(self, channel: Channel, frames: list[str] | None) -> None:
        self._channel, self._frames = channel, frames
        self._links: dict[str, tuple[str, Turn]] = {}  # of each frame its parent, and how it lies in that
        self._told = {"pose": 0.0, "velocity": 0.0}

    def hear_pose(self, message: Message) -> None:
        """Tell the pose in a message."""
        found = self._transformed(message) if self._frames else _pose_in(message)
        if found is not None:
            frame, (x, y, yaw) = found
            self._tell("pose", x=x, y=y, yaw=yaw, frame=frame)

    def hear_velocity(self, message: Message) -> None:
        """Tell the velocity in a message, in metres or radians per second, whichever is more."""
        while "linear" not in message and "twist" in message:
            message = message["twist"]
        if "linear" in message:
            linear, angular = message["linear"], message["angular"]
            self._tell("velocity", speed=max(math.hypot(linear["x"], linear["y"]), abs(angular["z"])))

    def _transformed(self, message: Message) -> tuple[str, Turn] | None:
        assert self._frames is not None, "poses come from transforms"
        for each in message["transforms"]:
            turn = _turn(each["transform"]["translation"], each["transform"]["rotation"])
            parent = each["header"]["frame_id"].lstrip("/")
            self._links[each["child_frame_id"].lstrip("/")] = parent, turn
        frame, robot = self._frames
        at, yaw = 0j, 0.0  # where the robot is in the frame that the loop has come to, x + iy
        for _ in self._links:
            if robot not in self._links:
                return None
            robot, (x, y, turned) = self._links[robot]
            at, yaw = complex(x, y) + at * cmath.rect(1.0, turned), yaw + turned
            if robot == frame:
                return frame, (at.real, at.imag, yaw)
        return None

    def _tell(self, what: str, **values: Any) -> None:
        now = time.monotonic()
        if now - self._told[what] >= EVERY:
            self._told[what] = now
            self._channel.send(what, **values)


def _pose_in(message: Message) -> tuple[str, Turn] | None:
    frame = message.get("header", {}).get("frame_id", "").lstrip("/")
    while "position" not in message and "pose" in message:
        message = message["pose"]
    return (frame, _turn(message["position"], message["orientation"])) if "position" in message else None


def _turn(position: Message, rotation: Message) -> Turn:
    x, y, z, w = (rotation[axis] for axis in "xyzw")
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return float(position["x"]), float(position["y"]), yaw
