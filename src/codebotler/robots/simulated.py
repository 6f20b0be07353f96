"""A simulated robot that drives at 0.5 metres per second."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Self

from codebotler.core.errors import RobotError, UserError
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Option, Trace, arguments_of_event
from codebotler.core.world import World, laid_out
from codebotler.robots.base import (
    CancelledError,
    Feedback,
    Options,
    RobotArgument,
    RobotResult,
    ignore_feedback,
)
from codebotler.robots.clock import Clock
from codebotler.simulator.settings import LIVE_LIMITS, SimulationSettings
from codebotler.simulator.worlds.matching import WORDS_FOR_PEOPLE
from codebotler.simulator.worlds.robot import SimulatedRobot

SIMULATION = SimulationSettings(
    literals="as-written",
    matching="longest-name",
    people="own-name-or-word",
    words_for_people=WORDS_FOR_PEOPLE,
    limits=LIVE_LIMITS,
)
METRES_PER_SECOND = 0.5
FEEDBACK_SECONDS = 0.25  # the real time between two position reports

OFFICE = Path(__file__).with_name("office.yaml")
"""An example world with printer rooms, a supply room and an office."""


class Simulated:
    """A simulated robot that takes time to drive and to perform its other skills.

    Args:
        world: the world that the robot works in.
        speed: the robot's clock seconds per real second, or None to skip all waits.
        skills: the skills that programs may call.

    Raises:
        UserError: the speed is out of range.
    """

    name, address, has_pose = "simulated", "", True
    if_tool_dies, rooms_are_regexes = "the simulated robot ended as well", True
    missing: Mapping[str, str] = MappingProxyType({})

    def __init__(self, world: World, *, speed: float | None = 1.0, skills: SkillTable = SKILLS) -> None:
        self.skills, self.clock, self._world = skills, Clock(speed), world
        self._stands_at = {room.name: room.stand_at or (0.0, 0.0) for room in laid_out(world).rooms}
        self._robot = SimulatedRobot(world, SIMULATION, skills)
        self._place = self._stands_at[world.robot]

    @classmethod
    def open(cls, options: Options) -> Self:
        """Create a robot. Raise UserError if the options have no world, or a speed that is out of range."""
        if options.world is None:
            raise UserError("a simulated robot needs a world; name one with --world FILE")
        return cls(options.world, speed=options.speed, skills=options.skills)

    def connect(self) -> None:
        """Reset the robot and all objects to the initial state of the world."""
        self._robot = SimulatedRobot(self._world, SIMULATION, self.skills)
        self._place = self._stands_at[self._world.robot]
        self.clock.restart()

    def resume(self, past: Trace) -> None:
        """Repeat the successful steps of an earlier mission without delays, to restore its world."""
        rows = {row.recording.kind: row for row in self.skills.rows if row.recording}
        for event in past:
            row = rows.get(event.kind)
            if row is not None and not event.failed:
                with suppress(RobotError):  # the world is another one, or a person said that this happened
                    perform_at_once(self._robot, row.name, arguments_of_event(row, event))
        self._place = self._stands_at[self._robot.room]

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Perform a skill, wait as long as the skill takes, and return its result.

        Raises:
            RobotError: the skill failed.
            CancelledError: the robot was stopped.
        """
        self._wait(0.0)
        if skill == "go_to":
            room = self._robot.room_for(str(arguments[0]))
            if room is not None:
                self._drive(room, feedback)
        else:
            self._wait(self.skills[skill].seconds)
        return perform_at_once(self._robot, skill, arguments)

    def cancel(self) -> None:
        """Stop the robot immediately, and refuse further skills until the next `connect`."""
        self.clock.stop()

    def disconnect(self) -> None:
        """Stop the robot. A simulated robot has no connection to close."""
        self.cancel()

    def _drive(self, room: str, feedback: Feedback) -> None:
        start, end = self._place, self._stands_at[room]
        takes = math.dist(start, end) / METRES_PER_SECOND
        step = takes if self.clock.speed is None else max(FEEDBACK_SECONDS * self.clock.speed, 1e-3)
        driven = 0.0
        if takes:
            feedback(f"at ({start[0]:.1f}, {start[1]:.1f})")
        while driven < takes:
            self._wait(min(step, takes - driven))
            driven = min(driven + step, takes)
            share = driven / takes
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self._place = (x, y)
            feedback(f"at ({x:.1f}, {y:.1f})")
        self._place = end

    def _wait(self, seconds: float) -> None:
        if not self.clock.wait(seconds):
            raise CancelledError


def perform_at_once(robot: SimulatedRobot, skill: str, arguments: Sequence[RobotArgument]) -> RobotResult:
    """Perform a skill in the simulator without delays. For a question, return the chosen option's text."""
    taken = robot.skills[skill].parameters
    given = [
        tuple(Option(str(text)) for text in a) if parameter.is_options and isinstance(a, tuple) else a
        for parameter, a in zip(taken, arguments, strict=True)
    ]
    result = robot.perform(skill, given)
    for parameter, argument in zip(taken, arguments, strict=True):
        if parameter.is_options and isinstance(argument, tuple) and isinstance(result, int):
            return argument[result]
    return result
