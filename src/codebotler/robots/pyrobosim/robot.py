"""The robot in pyrobosim: it plans its way around walls and drives it."""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from codebotler.core.errors import UserError
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.world import World
from codebotler.robots.base import (
    ROS_PYTHON,
    Argument,
    CancelledError,
    Feedback,
    NotReadyError,
    Options,
    Readiness,
    Result,
    no_feedback,
)
from codebotler.robots.clock import Clock
from codebotler.robots.simulated import ROBOT_RULES, SECONDS, performed
from codebotler.simulator.robot import SimulatedRobot, Thing, resolve_room

if TYPE_CHECKING:
    from codebotler.robots.pyrobosim.world import DrivableWorld

MISSING, MEND = "pyrobosim is not installed", 'pip install "codebotler[pyrobosim]"'


class Pyrobosim:
    """A robot in pyrobosim, which knows where it is, what it holds, and what lies where."""

    name, address = "pyrobosim", ""
    if_tool_dies = "the robot in pyrobosim ended with the tool"
    missing: Mapping[str, str] = MappingProxyType({})

    def __init__(self, world: World, *, speed: float | None = 1.0, skills: SkillTable = SKILLS) -> None:
        self.skills, self.clock = skills, Clock(speed)
        self._world = world
        self._drivable: DrivableWorld | None = None
        self._script = SimulatedRobot(world, ROBOT_RULES, skills)  # for people, errors and names of objects
        self._things: dict[object, Thing] = {}

    def connect(self) -> None:
        """Build the world in pyrobosim as it is at the start, if that is installed."""
        if importlib.util.find_spec("pyrobosim") is None:
            raise NotReadyError(f"{MISSING}; install it with: {MEND}")
        logger = logging.getLogger("pyrobosim")
        if not logger.handlers:  # or it logs to the terminal
            logger.addHandler(logging.NullHandler())
        from codebotler.robots.pyrobosim.world import DrivableWorld  # noqa: PLC0415 - takes a second, is an extra

        self.clock.restart()
        self._drivable = DrivableWorld(self._world, self.clock)
        self._script = SimulatedRobot(self._world, ROBOT_RULES, self.skills)
        self._things = {
            body: thing
            for room, bodies in self._drivable.objects.items()
            for body, thing in zip(bodies, self._script.things[room], strict=True)
        }

    def perform(self, skill: str, arguments: Sequence[Argument], feedback: Feedback = no_feedback) -> Result:
        """Execute a skill, taking its time."""
        assert self._drivable is not None, "the robot is not connected"
        self._wait(0.0)
        self._update_script(self._drivable)
        if skill == "go_to":
            return self._go_to(self._drivable, str(arguments[0]), feedback)
        if skill == "pick":
            return self._pick(self._drivable, str(arguments[0]), feedback)
        if skill == "place":
            return self._place(self._drivable, str(arguments[0]), feedback)
        self._wait(SECONDS.get(skill, 0.0))
        return performed(self._script, skill, arguments)

    def cancel(self) -> None:
        """Stop on the spot."""
        self.clock.stop()

    def disconnect(self) -> None:
        """Stop, and forget the world as it is now."""
        self.cancel()
        self._drivable = None

    def _update_script(self, world: DrivableWorld) -> None:
        """Copy from pyrobosim where the robot is, what it holds, and what lies where."""
        self._script.room = world.here or self._script.room
        self._script.things = {
            room: [self._things[body] for body in world.lying_in(room)] for room in self._script.rooms
        }
        self._script.held = None if world.held is None else self._things[world.held].label

    def _go_to(self, world: DrivableWorld, request: str, feedback: Feedback) -> Result:
        room = resolve_room(self._script.rooms, request)
        if room is not None:
            world.drive(room, feedback)
        return performed(self._script, "go_to", [request])

    def _pick(self, world: DrivableWorld, request: str, feedback: Feedback) -> Result:
        performed(self._script, "pick", [request])  # raises if there is nothing to pick up
        lying = world.lying_in(self._script.room)
        body = next(body for body in lying if self._things[body].is_meant_by(request))
        world.pick(body, request, feedback)
        self._things[body] = Thing(request, is_pattern=False)
        return None

    def _place(self, world: DrivableWorld, request: str, feedback: Feedback) -> Result:
        performed(self._script, "place", [request])  # raises if there is nothing to put down
        world.place(self._script.room, request, feedback)
        return None

    def _wait(self, seconds: float) -> None:
        if not self.clock.wait(seconds):
            raise CancelledError


def readiness(_ros_python: Path = ROS_PYTHON) -> Readiness:
    """Whether pyrobosim is installed."""
    if importlib.util.find_spec("pyrobosim") is None:
        return Readiness("pyrobosim", works=False, missing=MISSING, mend=MEND)
    return Readiness("pyrobosim", works=True, note="plans and drives through --world FILE, without a window")


def robot(options: Options) -> Pyrobosim:
    """The robot of these options, which must name a world."""
    if options.world is None:
        raise UserError("the robot in pyrobosim needs a world to be in; name one with --world FILE")
    return Pyrobosim(options.world, speed=options.speed, skills=options.skills)
