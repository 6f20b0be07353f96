"""Translate names between the robot's Unicode form and the composed form (NFC) that programs use."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from codebotler.core.text.unicode import compose
from codebotler.robots.base import Feedback, Robot, RobotArgument, RobotResult, ignore_feedback


class SpellingRobot:
    """Wraps a robot so that programs see composed names, while the robot gets names in its own spelling."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._spellings: dict[str, str] = {}  # the robot's spelling of each composed name

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute of the robot
        return getattr(self._robot, name)

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        """Perform a skill with names in the robot's own spelling."""
        given = [self._spellings.get(one, one) if isinstance(one, str) else one for one in arguments]
        result = self._robot.perform(skill, given, feedback)
        for text in result if isinstance(result, list) else [result]:
            if isinstance(text, str) and compose(text) != text:
                self._spellings[compose(text)] = text
        return compose(result)
