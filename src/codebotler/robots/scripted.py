"""What robots in worlds of ours have in common: how long skills take, and how the simulator answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from codebotler.core.trace import Option
from codebotler.robots.base import Argument, Result
from codebotler.simulator.robot import SimulatedRobot
from codebotler.simulator.rules import ENDLESS, Rules

AS_WRITTEN = Rules(literals="as-written", limits=ENDLESS)
METRES_PER_SECOND = 0.5
SECONDS: Mapping[str, float] = {"is_in_room": 1.0, "say": 1.0, "ask": 3.0, "pick": 5.0, "place": 3.0}
"""How long skills take by the robot's clock; driving takes its time by the way, what is not here none."""

TELLS_EVERY = 0.25
"""Real seconds from one feedback to the next."""


def performed(robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
    """What a skill does in the simulator, answered as a robot answers.

    Raises:
        RobotError: the robot cannot do it.
    """
    asked = tuple(a if isinstance(a, str) else tuple(map(Option, a)) for a in arguments)
    result = robot.perform(skill, asked)
    if isinstance(result, int) and not isinstance(result, bool):
        (options,) = (a for a in asked if not isinstance(a, str))
        return options[result].text
    return result
