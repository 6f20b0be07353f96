"""A robot in a world of our own: it drives at walking pace, and does the rest as in the simulator."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from codebotler.core.errors import UserError
from codebotler.core.skills import SKILLS, SkillTable
from codebotler.core.world import World, laid_out
from codebotler.robots.base import Argument, CancelledError, Feedback, Options, Readiness, Result, untold
from codebotler.robots.clock import Clock
from codebotler.robots.scripted import AS_WRITTEN, METRES_PER_SECOND, SECONDS, TELLS_EVERY, performed
from codebotler.simulator.robot import SimulatedRobot, resolve_room


class Simulated:
    """A simulated robot that takes its time.

    Args:
        world: where it is.
        speed: how many seconds of its clock pass in a real one; None if nothing takes real time.
        skills: what it can be asked to do.
        metres_per_second: how fast it drives, above 0; infinite if driving takes no time.

    Raises:
        UserError: the speed is out of its range.
    """

    name, address = "simulated", ""
    if_tool_dies = "the simulated robot ended with the tool"
    missing: Mapping[str, str] = MappingProxyType({})

    def __init__(
        self,
        world: World,
        *,
        speed: float | None = 1.0,
        skills: SkillTable = SKILLS,
        metres_per_second: float = METRES_PER_SECOND,
    ) -> None:
        self.skills, self.clock = skills, Clock(speed)
        self._world, self._pace = world, metres_per_second
        self._stands_at = {room.name: room.stand_at or (0.0, 0.0) for room in laid_out(world).rooms}
        self._robot: SimulatedRobot | None = None
        self._place = self._stands_at[world.robot]

    def connect(self) -> None:
        """Put the robot where the world has it; everything there is as at the start."""
        self._robot = SimulatedRobot(self._world, AS_WRITTEN, self.skills)
        self._place = self._stands_at[self._world.robot]
        self.resume()

    def resume(self) -> None:
        """Be ready again after a cancel, in the world as it has become."""
        self.clock.restart()

    def perform(self, skill: str, arguments: Sequence[Argument], told: Feedback = untold) -> Result:
        """Execute a skill, taking the time that it takes.

        Raises:
            RobotError: the robot cannot do it.
            CancelledError: the robot was stopped.
        """
        assert self._robot is not None, "the robot is not connected"
        self._wait(0.0)
        if skill == "go_to":
            self._drive(self._robot, str(arguments[0]), told)
        else:
            self._wait(SECONDS.get(skill, 0.0))
        return performed(self._robot, skill, arguments)

    def cancel(self) -> None:
        """Stop at once."""
        self.clock.stop()

    def disconnect(self) -> None:
        """Forget the world as it has become."""
        self.cancel()
        self._robot = None

    def _drive(self, robot: SimulatedRobot, request: str, told: Feedback) -> None:
        room = resolve_room(robot.rooms, request)
        if room is None:
            return
        start, end = self._place, self._stands_at[room]
        takes = math.dist(start, end) / self._pace
        step = takes if self.clock.speed is None else max(TELLS_EVERY * self.clock.speed, 1e-3)
        driven = 0.0
        while driven < takes:
            self._wait(min(step, takes - driven))
            driven = min(driven + step, takes)
            share = driven / takes
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self._place = (x, y)
            told(f"at ({x:.1f}, {y:.1f})")
        self._place = end

    def _wait(self, seconds: float) -> None:
        if not self.clock.wait(seconds):
            raise CancelledError


def readiness() -> Readiness:
    """It works everywhere."""
    return Readiness("sim", works=True, note="drives through --world FILE, with the people of that file")


def robot(options: Options) -> Simulated:
    """The simulated robot that a user means.

    Raises:
        UserError: no world was named, or the speed is out of its range.
    """
    if options.world is None:
        raise UserError("the simulated robot needs a world to be in; name one with --world FILE")
    return Simulated(options.world, speed=options.speed, skills=options.skills)
