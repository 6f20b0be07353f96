"""Extract a robot's poses and velocities from ROS messages and report them to CodeBotler."""

from __future__ import annotations

import cmath
import math
import time
from typing import Any

from channel import Channel, Fields

REPORT_INTERVAL = 0.05  # the minimum time in seconds between two reports of the same kind
Turn = tuple[float, float, float]  # the x, y and yaw of a coordinate frame relative to another


class MotionReports:
    """Reports a robot's poses and velocities to CodeBotler.

    With `frames`, the names of the map's and the robot's frame, poses are computed from transforms. Otherwise
    they are taken from messages of any type that contains a pose.
    """

    def __init__(self, channel: Channel, frames: list[str] | None) -> None:
        self._channel, self._frames = channel, frames
        self._links: dict[str, tuple[str, Turn]] = {}  # the parent of each frame, and the pose relative to it
        self._last_sent = {"pose": 0.0, "velocity": 0.0}

    def report_pose(self, message: Fields) -> None:
        """Report the robot's pose if the message contains it, or completes the transforms that give it."""
        found = self._transform(message) if self._frames else _pose_in(message)
        if found is not None:
            frame, (x, y, yaw) = found
            self._send("pose", x=x, y=y, yaw=yaw, frame=frame)

    def report_velocity(self, message: Fields) -> None:
        """Report the speed in a message: the higher value of metres per second and radians per second."""
        while "linear" not in message and "twist" in message:
            message = message["twist"]
        if "linear" in message:
            linear, angular = message["linear"], message["angular"]
            self._send("velocity", speed=max(math.hypot(linear["x"], linear["y"]), abs(angular["z"])))

    def _transform(self, message: Fields) -> tuple[str, Turn] | None:
        assert self._frames is not None, "the frames are not known"
        for each in message["transforms"]:
            turn = _turn(each["transform"]["translation"], each["transform"]["rotation"])
            parent = each["header"]["frame_id"].lstrip("/")
            self._links[each["child_frame_id"].lstrip("/")] = parent, turn
        frame, robot = self._frames
        at, yaw = 0j, 0.0  # the robot's position x + iy and yaw in the frame that the loop has reached
        for _ in self._links:
            if robot not in self._links:
                return None
            robot, (x, y, turned) = self._links[robot]
            at, yaw = complex(x, y) + at * cmath.rect(1.0, turned), yaw + turned
            if robot == frame:
                return frame, (at.real, at.imag, yaw)
        return None

    def _send(self, kind: str, **values: Any) -> None:
        now = time.monotonic()
        if now - self._last_sent[kind] >= REPORT_INTERVAL:
            self._last_sent[kind] = now
            self._channel.send(kind, **values)


def _pose_in(message: Fields) -> tuple[str, Turn] | None:
    frame = message.get("header", {}).get("frame_id", "").lstrip("/")
    while "position" not in message and "pose" in message:
        message = message["pose"]
    return (frame, _turn(message["position"], message["orientation"])) if "position" in message else None


def _turn(position: Fields, rotation: Fields) -> Turn:
    x, y, z, w = (rotation[axis] for axis in "xyzw")
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return float(position["x"]), float(position["y"]), yaw
