"""A robot and a model whose answers a test chooses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from codebotler.core.skills.paper import SKILLS
from codebotler.models.base import Reply, TextListener, Usage, ignore_text
from codebotler.models.sampling import SamplingSettings
from codebotler.prompts import Prompt
from codebotler.robots.base import CancelledError, Feedback, RobotArgument, RobotResult, ignore_feedback
from codebotler.robots.clock import Clock


class FakeRobot:
    """A robot that only answers.

    Args:
        answer: returns or raises the answer to a skill, given its name and its first argument.
    """

    name, address, if_tool_dies = "answering", "", "it ended with the tool"
    rooms_are_regexes = has_pose = False
    missing: Mapping[str, str] = MappingProxyType({})

    def __init__(self, answer: Callable[[str, str], RobotResult] = lambda *_: None) -> None:
        self.answer, self.clock, self.skills = answer, Clock(None), SKILLS
        self.done: list[str] = []
        self.cancels = self.connections = 0

    def connect(self) -> None:
        self.connections += 1
        self.cancels = 0
        self.clock.restart()

    def perform(
        self, skill: str, arguments: Sequence[RobotArgument], feedback: Feedback = ignore_feedback
    ) -> RobotResult:
        if self.cancels:
            raise CancelledError
        first = str(arguments[0]) if arguments else ""
        feedback(f"doing {skill}")
        result = self.answer(skill, first)
        self.done.append(first or skill)
        return result

    def cancel(self) -> None:
        self.cancels += 1

    def disconnect(self) -> None:
        self.connections -= 1


def fail_with(error: Exception) -> Callable[[str, str], RobotResult]:
    """Make an answer that raises an error."""

    def answer(_skill: str, _first: str) -> RobotResult:
        raise error

    return answer


def replay(*results: RobotResult) -> Callable[[str, str], RobotResult]:
    """Make answers that return these results, one after the other."""
    rest = iter(results)
    return lambda _skill, _first: next(rest)


class FakeModel:
    """A model that writes one program after another."""

    name = "several"
    settings = SamplingSettings()

    def __init__(self, programs: Sequence[str]) -> None:
        self.programs, self.prompts = programs, list[Prompt]()

    async def reply(self, prompt: Prompt, *, number: int, on_text: TextListener = ignore_text) -> Reply:
        self.prompts.append(prompt)
        program = self.programs[number]
        on_text(program)
        return Reply(program, program, Usage(), None, "stop", no_program=None if program else "no-code")

    async def close(self) -> None:
        """Do nothing."""
