"""A robot simulated in pyrobosim, which plans paths around walls and drives along them."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from codebotler.core.errors import UserError
from codebotler.robots.base import (
    ROS_PYTHON,
    Feedback,
    Options,
    Readiness,
    RobotArgument,
    RobotResult,
    ignore_feedback,
)
from codebotler.robots.simulated import Simulated, perform_at_once
from codebotler.simulator.entities import Thing

if TYPE_CHECKING:
    from codebotler.robots.pyrobosim.world import DrivableWorld


class Pyrobosim(Simulated):
    """A simulated robot whose position and objects are kept in pyrobosim."""

    name = "pyrobosim"
    if_tool_dies, rooms_are_regexes = "the robot in pyrobosim ended as well", True
    _drivable: DrivableWorld

    def connect(self) -> None:
        """Build the world in pyrobosim, in its initial state."""
        logger = logging.getLogger("pyrobosim")
        if not logger.handlers:  # without a handler, pyrobosim adds one that prints to the terminal
            logger.addHandler(logging.NullHandler())
        from codebotler.robots.pyrobosim.world import DrivableWorld  # noqa: PLC0415 - slow, and optional

        super().connect()
        self._drivable = DrivableWorld(self._world, self.clock)
        self._things = {
            body: thing
            for room, bodies in self._drivable.objects.items()
            for body, thing in zip(bodies, self._robot.contents[room], strict=True)
        }

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Perform a skill. Driving, picking and placing run in pyrobosim."""
        self._wait(0.0)
        self._update()
        if skill not in {"pick", "place"}:
            return super().perform(skill, arguments, feedback)
        request, room = str(arguments[0]), self._robot.room
        perform_at_once(self._robot, skill, arguments)  # raises if there is no object to pick or place
        if skill == "place":
            self._drivable.place(room, request, feedback)
            return None
        objects = self._drivable.objects_in(room)
        body = next(body for body in objects if self._things[body] is self._robot.taken)
        self._drivable.pick(body, request, feedback)
        self._things[body] = Thing(request, is_pattern=False)
        return None

    def _update(self) -> None:
        """Copy the robot's room, the held object and all other objects from pyrobosim to the simulator."""
        world, robot = self._drivable, self._robot
        robot.room = world.room or robot.room
        robot.contents = {
            room: [self._things[body] for body in world.objects_in(room)] for room in robot.rooms
        }
        robot.held = None if world.held is None else self._things[world.held].label

    def _drive(self, room: str, feedback: Feedback) -> None:
        self._drivable.drive(room, feedback)


def readiness(_ros_python: Path = ROS_PYTHON) -> Readiness:
    """Report pyrobosim as available, or raise ModuleNotFoundError if it is not installed."""
    if importlib.util.find_spec("pyrobosim") is None:
        raise ModuleNotFoundError("pyrobosim is not installed", name="pyrobosim")
    return Readiness("pyrobosim", works=True, note="plans and drives through --world FILE, without a window")


def robot(options: Options) -> Pyrobosim:
    """Create the robot, or raise UserError if the options contain no world."""
    if options.world is None:
        raise UserError("the robot in pyrobosim needs a world; name one with --world FILE")
    readiness()
    return Pyrobosim(options.world, speed=options.speed, skills=options.skills)
