"""`StopButton`: the only way to stop the robot of a mission."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack

from codebotler.robots.base import Robot

STOP_REQUEST_SECONDS = 6.0
"""The time that a stop request may take to reach the robot, in seconds."""


class StopButton:
    """Stops a robot, then notifies listeners. It can be pressed repeatedly and from any thread."""

    def __init__(self, robot: Robot | None = None) -> None:
        self.robot = robot
        self.by: str | None = None  # the source of the first press
        self.ended = threading.Event()  # set before the robot is cancelled; no skill starts afterwards
        self._has_reached = threading.Event()
        self._pressed_at, self._reached_at = 0.0, math.inf
        self._listeners: list[Callable[[], None]] = []
        self._lock = threading.Lock()  # held briefly

    def press(self, by: str) -> None:
        """Stop the robot, then call all listeners, even if some fail. `by` names the source for the log."""
        now = time.monotonic()
        with ExitStack() as afterwards:
            with self._lock:
                if self.by is None:
                    self.by, self._pressed_at = by, now
                for listener in self._listeners:
                    afterwards.callback(listener)
            self.cancel_robot()

    def cancel_robot(self) -> None:
        """Cancel the robot's work and prevent further skills, without recording a source."""
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
        """Set the connected robot, and cancel it at once if the button was already pressed."""
        self.robot = robot
        if self.by is not None:
            self.cancel_robot()

    def on_press(self, listener: Callable[[], None]) -> None:
        """Call `listener` at each later press, and at once if the button was already pressed."""
        with self._lock:
            self._listeners.append(listener)
            is_pressed = self.by is not None
        if is_pressed:
            listener()

    @property
    def seconds(self) -> float:
        """Seconds from the first press until the robot received the stop request, or until now if pending."""
        return max(0.0, min(self._reached_at, time.monotonic()) - self._pressed_at)

    def why_unstopped(self) -> str:
        """Return why the robot did not stop, or "" if it did or gives no reason. Wait up to 6 seconds."""
        if self.ended.is_set():
            self._has_reached.wait(STOP_REQUEST_SECONDS)
        return str(getattr(self.robot, "failed_stop", ""))  # optional
