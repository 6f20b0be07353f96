"""The robot in pyrobosim: it plans its way around walls and drives it."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from codebotler.core.errors import UserError, install_command
from codebotler.robots.base import (
    ROS_PYTHON,
    Argument,
    Feedback,
    Options,
    Readiness,
    Result,
    no_feedback,
)
from codebotler.robots.simulated import Simulated, performed
from codebotler.simulator.robot import Thing

if TYPE_CHECKING:
    from codebotler.robots.pyrobosim.world import DrivableWorld

MISSING, MEND = "pyrobosim is not installed", install_command("pyrobosim")


class Pyrobosim(Simulated):
    """A robot in pyrobosim, which knows where it is, what it holds, and what lies where.

    People, errors and names of objects are those of the simulated robot.
    """

    name = "pyrobosim"
    if_tool_dies, rooms_are_regexes = "the robot in pyrobosim ended with the tool", True
    _drivable: DrivableWorld

    def connect(self) -> None:
        """Build the world in pyrobosim as it is at the start."""
        logger = logging.getLogger("pyrobosim")
        if not logger.handlers:  # or it logs to the terminal
            logger.addHandler(logging.NullHandler())
        from codebotler.robots.pyrobosim.world import DrivableWorld  # noqa: PLC0415 - takes a second, is an extra

        super().connect()
        self._drivable = DrivableWorld(self._world, self.clock)
        self._things = {
            body: thing
            for room, bodies in self._drivable.objects.items()
            for body, thing in zip(bodies, self._robot.things[room], strict=True)
        }

    def perform(self, skill: str, arguments: Sequence[Argument], feedback: Feedback = no_feedback) -> Result:
        """Execute a skill, taking its time."""
        self._wait(0.0)
        self._update()
        if skill not in {"pick", "place"}:
            return super().perform(skill, arguments, feedback)
        request, room = str(arguments[0]), self._robot.room
        performed(self._robot, skill, arguments)  # raises if there is nothing to pick up or to put down
        if skill == "place":
            self._drivable.place(room, request, feedback)
            return None
        lying = self._drivable.lying_in(room)
        body = next(body for body in lying if self._things[body].is_meant_by(request))
        self._drivable.pick(body, request, feedback)
        self._things[body] = Thing(request, is_pattern=False)
        return None

    def _update(self) -> None:
        """Copy from pyrobosim where the robot is, what it holds, and what lies where."""
        world, robot = self._drivable, self._robot
        robot.room = world.here or robot.room
        robot.things = {room: [self._things[body] for body in world.lying_in(room)] for room in robot.rooms}
        robot.held = None if world.held is None else self._things[world.held].label

    def _drive(self, room: str, feedback: Feedback) -> None:
        self._drivable.drive(room, feedback)


def readiness(_ros_python: Path = ROS_PYTHON) -> Readiness:
    """Whether pyrobosim is installed."""
    if importlib.util.find_spec("pyrobosim") is None:
        return Readiness("pyrobosim", works=False, missing=MISSING, mend=MEND)
    return Readiness("pyrobosim", works=True, note="plans and drives through --world FILE, without a window")


def robot(options: Options) -> Pyrobosim:
    """The robot of these options, which must name a world."""
    if options.world is None:
        raise UserError("the robot in pyrobosim needs a world; name one with --world FILE")
    if importlib.util.find_spec("pyrobosim") is None:
        raise UserError(f"{MISSING}; `{MEND}` installs it")
    return Pyrobosim(options.world, speed=options.speed, skills=options.skills)
