"""Track a robot's pose and whether the robot stands still, from reported poses and velocities."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

STILL_SECONDS = 0.5  # how long a robot must be motionless to count as standing still
MIN_METRES, MIN_RADIANS = 0.02, 0.05  # smaller changes of the pose count as noise
MAX_UNSEEN = 1.0  # the metres or radians a robot may move without a pose before its pose is unknown
MAX_INTERVAL = 0.5  # the longest time in seconds for which a reported velocity is assumed to last
MIN_SPEED_MOVING = 0.02  # the speed, in metres or radians per second, above which a robot counts as moving


@dataclass(frozen=True)
class Pose:
    """A robot's position in metres and yaw in radians, relative to a coordinate frame."""

    x: float
    y: float
    yaw: float
    frame: str


class Motion:
    """Tracks a robot's motion from reported poses and velocities. It is thread-safe."""

    def __init__(self) -> None:
        self.pose: Pose | None = None
        self._rest: Pose | None = None  # the pose after the last movement
        self._last_report = self._last_move = self._last_velocity = -math.inf
        self._unseen = 0.0  # the metres or radians moved since the last pose

    def record(self, message: Mapping[str, Any]) -> None:
        """Record a pose or velocity message from a worker."""
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
        """Whether the robot has sent reports in the last 0.5 s, and none of them shows a movement."""
        now = time.monotonic()
        return self._last_report > now - STILL_SECONDS > self._last_move

    @property
    def is_unseen(self) -> bool:
        """Whether the last pose is outdated: the robot has moved more than 1 metre or 1 radian since then."""
        return self._unseen > MAX_UNSEEN

    @property
    def is_silent(self) -> bool:
        """Whether there was no report for 1 s. AMCL, for example, is silent while a robot stands still."""
        return self._last_report < time.monotonic() - 2 * STILL_SECONDS

    @property
    def is_moving(self) -> bool:
        """Whether a report of the last 0.5 s shows that the robot moves."""
        return self._last_move > time.monotonic() - STILL_SECONDS


def _is_apart(one: Pose, other: Pose) -> bool:
    turned = math.remainder(one.yaw - other.yaw, math.tau)
    return math.hypot(one.x - other.x, one.y - other.y) > MIN_METRES or abs(turned) > MIN_RADIANS
