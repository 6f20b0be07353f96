"""A robot in pyrobosim, a simulator that roboticists know: it plans its ways around walls, and drives them.

People, and what they answer, are those of the world file, as with the simulated robot.
"""

from __future__ import annotations

import importlib.util
import logging
from collections.abc import Mapping, Sequence
from importlib import metadata
from types import MappingProxyType
from typing import TYPE_CHECKING

from codebotler.core.errors import UserError
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.world import World
from codebotler.robots.base import (
    Argument,
    CancelledError,
    Feedback,
    NotReadyError,
    Options,
    Readiness,
    Result,
    untold,
)
from codebotler.robots.clock import Clock
from codebotler.robots.scripted import AS_WRITTEN, SECONDS, performed
from codebotler.simulator.robot import SimulatedRobot, Thing, resolve_room

if TYPE_CHECKING:
    from codebotler.robots.pyrobosim.world import Stage

MEND = 'pip install "codebotler[pyrobosim]"'
OLDEST = 5
"""Of the versions of pyrobosim, the first number of the oldest that will do."""


class Pyrobosim:
    """A robot in pyrobosim, which knows where it is, what it holds, and what lies where.

    Args:
        world: where it is, with the people there.
        speed: how many seconds of its clock pass in a real one; None if nothing takes real time.
        skills: what it can be asked to do.

    Raises:
        UserError: the speed is out of its range.
    """

    name, address = "pyrobosim", ""
    if_tool_dies = "the robot in pyrobosim ended with the tool"
    missing: Mapping[str, str] = MappingProxyType({})

    def __init__(self, world: World, *, speed: float | None = 1.0, skills: SkillTable = SKILLS) -> None:
        self.skills, self.clock = skills, Clock(speed)
        self._world = world
        self._stage: Stage | None = None
        self._script = SimulatedRobot(world, AS_WRITTEN, skills)
        self._things: dict[object, Thing] = {}

    def connect(self) -> None:
        """Build the world in pyrobosim, as it is at the start, with the robot at rest.

        Raises:
            NotReadyError: pyrobosim is not installed, or cannot have the rooms as they are.
        """
        missing = _missing()
        if missing:
            raise NotReadyError(f"{missing}; install it with: {MEND}")
        logger = logging.getLogger("pyrobosim")
        if not logger.handlers:  # or it logs to the terminal
            logger.addHandler(logging.NullHandler())
        from codebotler.robots.pyrobosim.world import Stage  # noqa: PLC0415 - takes a second, and is an extra

        self.clock.restart()
        self._stage = Stage(self._world, self.clock)
        self._script = SimulatedRobot(self._world, AS_WRITTEN, self.skills)
        self._things = {
            body: thing
            for room, bodies in self._stage.objects.items()
            for body, thing in zip(bodies, self._script.things[room], strict=True)
        }

    def perform(self, skill: str, arguments: Sequence[Argument], told: Feedback = untold) -> Result:
        """Execute a skill, taking the time that it takes.

        Raises:
            RobotError: the robot cannot do it.
            CancelledError: the robot was stopped.
        """
        assert self._stage is not None, "the robot is not connected"
        self._wait(0.0)
        self._look(self._stage)
        if skill == "go_to":
            return self._go_to(self._stage, str(arguments[0]), told)
        if skill == "pick":
            return self._pick(self._stage, str(arguments[0]), told)
        if skill == "place":
            return self._place(self._stage, str(arguments[0]), told)
        self._wait(SECONDS.get(skill, 0.0))
        return performed(self._script, skill, arguments)

    def cancel(self) -> None:
        """Stop where it is."""
        self.clock.stop()

    def disconnect(self) -> None:
        """Forget the world as it has become."""
        self.cancel()
        self._stage = None

    def _look(self, stage: Stage) -> None:
        """Let the script be of the world as it is in pyrobosim."""
        self._script.room = stage.here or self._script.room
        self._script.things = {
            room: [self._things[body] for body in stage.lying_in(room)] for room in self._script.rooms
        }
        self._script.held = None if stage.held is None else self._things[stage.held].label

    def _go_to(self, stage: Stage, request: str, told: Feedback) -> Result:
        room = resolve_room(self._script.rooms, request)
        if room is not None:
            stage.drive(room, told)
        return performed(self._script, "go_to", [request])

    def _pick(self, stage: Stage, request: str, told: Feedback) -> Result:
        performed(self._script, "pick", [request])  # or there is nothing to be picked up
        lying = stage.lying_in(self._script.room)
        body = next(body for body in lying if self._things[body].is_meant_by(request))
        stage.pick(body, request, told)
        self._things[body] = Thing(request, is_pattern=False)
        return None

    def _place(self, stage: Stage, request: str, told: Feedback) -> Result:
        performed(self._script, "place", [request])  # or there is nothing to be placed
        stage.place(self._script.room, request, told)
        return None

    def _wait(self, seconds: float) -> None:
        if not self.clock.wait(seconds):
            raise CancelledError


def readiness() -> Readiness:
    """Whether pyrobosim is installed."""
    missing = _missing()
    if missing:
        return Readiness("pyrobosim", works=False, missing=missing, mend=MEND)
    return Readiness("pyrobosim", works=True, note="plans and drives through --world FILE, without a window")


def robot(options: Options) -> Pyrobosim:
    """The robot in pyrobosim that a user means.

    Raises:
        UserError: no world was named, or the speed is out of its range.
    """
    if options.world is None:
        raise UserError("the robot in pyrobosim needs a world to be in; name one with --world FILE")
    return Pyrobosim(options.world, speed=options.speed, skills=options.skills)


def _missing() -> str:
    """What is missing, in a phrase."""
    if importlib.util.find_spec("pyrobosim") is None:
        return "pyrobosim is not installed"
    version = metadata.version("pyrobosim")
    if int(version.partition(".")[0]) < OLDEST:
        return f"pyrobosim {version} is too old, it must be {OLDEST} or later"
    return ""
