"""A robot that speaks with people on a face; whatever else it does, another one does for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from codebotler.core.skills import SKILLS, SkillTable
from codebotler.robots.base import Argument, CancelledError, Feedback, Result, Robot, untold
from codebotler.robots.clock import Clock
from codebotler.robots.face import Face
from codebotler.simulator.robot import RobotError

SAY, ASK = "say", "ask"
SPOKEN = frozenset({SAY, ASK})
"""Skills that a face has; no robot behind it needs them."""

AT_LEAST, AT_MOST, LETTERS_PER_SECOND = 1.0, 10.0, 20.0
"""So many seconds, by the robot's clock, does it take to say something, and so long is it shown alone."""


def unspoken(skills: SkillTable = SKILLS) -> SkillTable:
    """The skills that the robot behind a face is asked for."""
    return SkillTable(tuple(skill for skill in skills.rows if skill.name not in SPOKEN))


class Faced:
    """A robot with a face.

    Args:
        robot: does what is not spoken; it may lack `say` and `ask`.
        face: on which it speaks.
        skills: what both can be asked to do.
    """

    def __init__(self, robot: Robot, face: Face, skills: SkillTable = SKILLS) -> None:
        self._robot, self._face, self.skills = robot, face, skills

    @property
    def name(self) -> str:
        """The kind of the robot behind it."""
        return self._robot.name

    @property
    def address(self) -> str:
        """That of the robot behind it."""
        return self._robot.address

    @property
    def if_tool_dies(self) -> str:
        """What becomes of the robot behind it; a question is gone with the tool."""
        return self._robot.if_tool_dies

    @property
    def missing(self) -> Mapping[str, str]:
        """What the robot behind it cannot do, but for what is spoken."""
        return {skill: why for skill, why in self._robot.missing.items() if skill not in SPOKEN}

    @property
    def clock(self) -> Clock:
        """That of the robot behind it."""
        return self._robot.clock

    def connect(self) -> None:
        """Make the robot ready, and the face.

        Raises:
            NotReadyError: the robot cannot be used.
        """
        self._robot.connect()
        self._face.open()

    def perform(self, skill: str, arguments: Sequence[Argument], told: Feedback = untold) -> Result:
        """Speak, or have the robot execute a skill.

        Raises:
            RobotError: nobody answered in time, or the robot cannot do it.
            CancelledError: it was stopped.
            RobotLostError: the robot is gone.
        """
        if skill not in SPOKEN:
            return self._robot.perform(skill, arguments, told)
        screens = self._face.screens
        told(f"shown on {screens} {'face' if screens == 1 else 'faces'}" if screens else "no face is open")
        if skill == SAY:
            self._say(str(arguments[0]))
            return None
        return self._ask(*arguments)

    def cancel(self) -> None:
        """Take back what is asked, and stop the robot."""
        try:
            self._face.withdraw()
        finally:
            self._robot.cancel()

    def disconnect(self) -> None:
        """Take back what is asked, and let go of the robot."""
        self._face.withdraw()
        self._robot.disconnect()

    def _say(self, text: str) -> None:
        self._face.say(text)
        seconds = min(max(AT_LEAST, len(text) / LETTERS_PER_SECOND), AT_MOST)
        if not self.clock.wait(seconds):
            raise CancelledError

    def _ask(self, person: Argument, question: Argument, options: Argument) -> str:
        if not options:
            raise RobotError("AskEmptyOptions", f'the question "{question}" offers no options')
        return options[self._face.ask(str(person), str(question), tuple(options))]
