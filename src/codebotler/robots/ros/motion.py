"""Track a robot's pose, and whether it stands still, from its poses and velocities."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

STILL_SECONDS = 0.5  # without movement
MIN_METRES, MIN_RADIANS = 0.02, 0.05  # smaller changes are no movement
MAX_UNSEEN = 1.0  # metres or radians without a pose, after which the pose is unknown
MAX_INTERVAL = 0.5  # seconds between two velocities of one motion
MIN_SPEED_MOVING = 0.02  # metres or radians per second


@dataclass(frozen=True)
class Pose:
    """A robot's pose, in metres and radians, in a frame."""

    x: float
    y: float
    yaw: float
    frame: str


class Motion:
    """Collects a robot's poses and velocities; thread-safe."""

    def __init__(self) -> None:
        self.pose: Pose | None = None
        self._rest: Pose | None = None  # the pose after the last movement
        self._last_report = self._last_move = self._last_velocity = -math.inf
        self._unseen = 0.0  # metres or radians since the last pose

    def record(self, message: Mapping[str, Any]) -> None:
        """Record a pose or a velocity."""
        self._last_report = now = time.monotonic()
        if message["is"] == "velocity":
            self._last_move = now if message["speed"] > MIN_SPEED_MOVING else self._last_move
            self._unseen += message["speed"] * min(now - self._last_velocity, MAX_INTERVAL)
            self._last_velocity = now
            return
        self._unseen = 0.0
        self.pose = pose = Pose(message["x"], message["y"], message["yaw"], message["frame"])
        if self._rest is None or _is_apart(pose, self._rest):
            self._rest, self._last_move = pose, now

    @property
    def is_still(self) -> bool:
        """Whether the reports show that the robot stands still."""
        now = time.monotonic()
        return self._last_report > now - STILL_SECONDS > self._last_move

    @property
    def is_unseen(self) -> bool:
        """Whether the robot has moved without reporting poses, according to its velocity."""
        return self._unseen > MAX_UNSEEN

    @property
    def is_silent(self) -> bool:
        """Whether there was no report for a while; AMCL is silent while a robot stands still."""
        return self._last_report < time.monotonic() - 2 * STILL_SECONDS

    @property
    def is_moving(self) -> bool:
        """Whether the reports show that the robot moves."""
        return self._last_move > time.monotonic() - STILL_SECONDS


def _is_apart(one: Pose, other: Pose) -> bool:
    turned = math.remainder(one.yaw - other.yaw, math.tau)
    return math.hypot(one.x - other.x, one.y - other.y) > MIN_METRES or abs(turned) > MIN_RADIANS
