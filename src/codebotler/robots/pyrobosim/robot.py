"""A robot simulated in pyrobosim, which plans paths around walls and drives along them."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from copy import deepcopy
from typing import TYPE_CHECKING

from codebotler.core.trace import Trace
from codebotler.robots.base import Feedback, RobotArgument, RobotResult, ignore_feedback
from codebotler.robots.simulated import Simulated, perform_at_once

if TYPE_CHECKING:
    from codebotler.robots.pyrobosim.world import DrivableWorld


class Pyrobosim(Simulated):
    """A robot in the simulator pyrobosim. It avoids walls, and picks and places objects at tables."""

    name = "pyrobosim"
    if_tool_dies = "the robot in pyrobosim ended as well"
    _drivable: DrivableWorld

    def connect(self) -> None:
        """Build the world in pyrobosim in its initial state. Raise NotReadyError if its rooms do not fit."""
        logger = logging.getLogger("pyrobosim")
        if not logger.handlers:  # without a handler, pyrobosim adds one that prints to the terminal
            logger.addHandler(logging.NullHandler())
        from codebotler.robots.pyrobosim.world import DrivableWorld  # noqa: PLC0415 - slow, and optional

        super().connect()
        self._drivable = DrivableWorld(self._world, self.clock)

    def resume(self, past: Trace) -> None:
        """Repeat the successful steps of an earlier mission without delays, to restore its world."""
        super().resume(past)
        self._drivable.put_robot(self._robot.room)

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Perform a skill and return its result. Before `pick` or `place`, drive to the table in the room."""
        self._wait(0.0)
        room = self._robot.room = self._drivable.room or self._robot.room  # a drive may have been stopped
        if skill in {"pick", "place"}:
            perform_at_once(deepcopy(self._robot), skill, arguments)  # raises if it is impossible
            self._drivable.approach_table(room, skill, str(arguments[0]), feedback)
        return super().perform(skill, arguments, feedback)

    def _drive(self, room: str, feedback: Feedback) -> None:
        self._drivable.drive(room, feedback)
