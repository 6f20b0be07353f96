"""Where a robot is, and whether it stands still, as its poses and velocities tell."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

STILL = 0.5  # seconds without a movement, after which it stands still
METRES, RADIANS = 0.02, 0.05  # by which it must have moved
UNSEEN = 1.0  # metres, or radians, of motion without a pose, after which nobody knows where it is
LONGEST = 0.5  # seconds between two velocities that count as one motion
SPEED = 0.02  # metres or radians per second at which it moves


@dataclass(frozen=True)
class Pose:
    """Where a robot is, in metres and radians of a frame."""

    x: float
    y: float
    yaw: float
    frame: str


class Motion:
    """What a robot reports of its motion, from any thread."""

    def __init__(self) -> None:
        self.pose: Pose | None = None
        self._rested: Pose | None = None  # since it last moved
        self._heard = self._moved = self._sped = -math.inf
        self._unseen = 0.0  # how far it has moved since its last pose

    def take(self, message: Mapping[str, Any]) -> None:
        """Take a pose or a velocity."""
        self._heard = now = time.monotonic()
        if message["is"] == "velocity":
            self._moved = now if message["speed"] > SPEED else self._moved
            self._unseen += message["speed"] * min(now - self._sped, LONGEST)
            self._sped = now
            return
        self._unseen = 0.0
        self.pose = here = Pose(message["x"], message["y"], message["yaw"], message["frame"])
        if self._rested is None or _is_apart(here, self._rested):
            self._rested, self._moved = here, now

    @property
    def is_still(self) -> bool:
        """Whether it reports that it stands still."""
        now = time.monotonic()
        return self._heard > now - STILL > self._moved

    @property
    def is_unseen(self) -> bool:
        """Whether it has moved on without telling where it is, as its velocity says."""
        return self._unseen > UNSEEN

    @property
    def is_silent(self) -> bool:
        """Whether it has reported nothing for a while, as AMCL does where a robot stands still."""
        return self._heard < time.monotonic() - 2 * STILL

    @property
    def is_moving(self) -> bool:
        """Whether it reports that it moves."""
        return self._moved > time.monotonic() - STILL


def _is_apart(one: Pose, other: Pose) -> bool:
    turned = math.remainder(one.yaw - other.yaw, math.tau)
    return math.hypot(one.x - other.x, one.y - other.y) > METRES or abs(turned) > RADIANS
