"""A robot whose names may be in another form of Unicode than those of programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from codebotler.core.unicode import composed
from codebotler.robots.base import Argument, Feedback, Result, Robot, no_feedback


class SpellingRobot:
    """A robot that answers in composed texts, and is asked for what it named in its own spelling."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._spellings: dict[str, str] = {}  # its own, by the composed ones

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the robot has
        return getattr(self._robot, name)

    def perform(self, skill: str, arguments: Sequence[Argument], feedback: Feedback = no_feedback) -> Result:
        """Have the robot execute a skill."""
        given = [self._spellings.get(one, one) if isinstance(one, str) else one for one in arguments]
        result = self._robot.perform(skill, given, feedback)
        for text in result if isinstance(result, list) else [result]:
            if isinstance(text, str) and composed(text) != text:
                self._spellings[composed(text)] = text
        return composed(result)
