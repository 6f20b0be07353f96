"""`StopButton`: the one way in which a mission's robot is stopped."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack

from codebotler.robots.base import Robot

STOP_REQUEST_SECONDS = 6.0
"""Seconds that a request to stop may take to reach a robot, before its answer is read."""


class StopButton:
    """Stops a robot first, and then all else that listens; from any thread, any number of times.

    Args:
        robot: the robot, or None until it is connected.
    """

    def __init__(self, robot: Robot | None = None) -> None:
        self.robot = robot
        self.by: str | None = None  # the person or thing that pressed it first
        self.ended = threading.Event()  # set before the robot is stopped; no skill starts from then on
        self._has_reached = threading.Event()
        self._pressed_at, self._reached_at = 0.0, math.inf
        self._listeners: list[Callable[[], None]] = []
        self._lock = threading.Lock()  # held for moments only

    def press(self, by: str) -> None:
        """Stop the robot, then call all listeners, the newest first; an error of one delays no other.

        Args:
            by: the person or thing that stops it, in words such as `Ctrl-C`.
        """
        now = time.monotonic()
        with ExitStack() as afterwards:
            with self._lock:
                if self.by is None:
                    self.by, self._pressed_at = by, now
                for listener in self._listeners:
                    afterwards.callback(listener)
            self.cancel_robot()

    def cancel_robot(self) -> None:
        """Cancel the robot's work and let no skill start, without a mark of who wanted it."""
        self.ended.set()
        robot = self.robot
        if robot is None:
            return
        try:
            robot.cancel()
        finally:
            robot.clock.stop()
            self._reached_at = min(self._reached_at, time.monotonic())
            self._has_reached.set()

    def attach(self, robot: Robot) -> None:
        """Take a robot that was connected, and cancel it at once if the button was pressed before."""
        self.robot = robot
        if self.by is not None:
            self.cancel_robot()

    def on_press(self, listener: Callable[[], None]) -> None:
        """Call a function at each press, and now if the button was pressed before."""
        with self._lock:
            self._listeners.append(listener)
            is_pressed = self.by is not None
        if is_pressed:
            listener()

    @property
    def seconds(self) -> float:
        """Seconds from the first press until the robot had the request, or until now."""
        return max(0.0, min(self._reached_at, time.monotonic()) - self._pressed_at)

    def why_unstopped(self) -> str:
        """Return why the robot could not be stopped after a request; empty if it was, as far as it knows."""
        if self.ended.is_set():
            self._has_reached.wait(STOP_REQUEST_SECONDS)
        return str(getattr(self.robot, "failed_stop", ""))  # which some robots have
