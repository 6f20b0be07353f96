"""The ledger of a run: what its skills cost, which limit it reached, and how the robot answered."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeAlias

from codebotler.core.skills import SkillTable
from codebotler.core.trace import Trace
from codebotler.simulator.robot import Argument, Result, RobotError
from codebotler.simulator.rules import Rules

OPTION_OVERHEAD = 10  # characters that an option counts more than it has: empty ones take memory, too
WAITS = "it waits for something that can never come"
# What kind of answer, what it says, and whether looking may show something else now.
SkillAnswer: TypeAlias = tuple[str, object, bool]
STOP: SkillAnswer = ("stop", None, False)


class SkillPerformer(Protocol):
    """A robot, as a run needs it; executing a skill may take as long as it likes."""

    rules: Rules
    skills: SkillTable
    is_live: bool  # time passes by itself: sleeping takes it, and each skill refuels the program
    never_fails: frozenset[str]  # skills that return nothing and cannot fail, so that nobody waits for them
    surely: tuple[tuple[str, str], ...]  # skills and their only arguments that always succeed
    only_looks: frozenset[str]  # skills whose result stays the same until another skill is executed

    @property
    def now(self) -> float:
        """What the program's clock shows, in seconds since the start."""

    @property
    def trace(self) -> Trace:
        """What it has done so far."""

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute one skill, or raise RobotError."""

    def sleep_until(self, now: float) -> None:
        """Let time pass, until `now` seconds since the start; back at once when it is to stop."""


class Ledger:
    """What one run has asked of its robot, and how much it may still ask."""

    def __init__(self, robot: SkillPerformer) -> None:
        self.robot, self.limits = robot, robot.rules.limits
        self.calls = self.text = 0  # characters of all texts
        self.limit: str | None = None  # the one that was reached, in words
        self.errors: list[RobotError] = []

    def perform(self, skill: str, arguments: Sequence[Argument]) -> SkillAnswer:
        """Let the robot execute one skill, unless that goes beyond a limit."""
        self._spend(arguments)
        if self.limit is not None:
            return STOP
        try:
            result = self.robot.perform(skill, arguments)
        except RobotError as error:
            self.errors.append(error)
            return ("error", (len(self.errors) - 1, error.kind, str(error)), True)
        return ("ok", result, skill not in self.robot.only_looks)

    def let_time_pass(self, now: float) -> None:
        """Let simulated time pass, until `now` seconds since the start, or until its limit."""
        if now > self.limits.seconds:
            now = self.limits.seconds
            self.limit = f"{self.limits.seconds:,.0f} seconds of simulated time"
        if now > self.robot.now:  # if it is less, the program has found the channel, and deceives itself
            self.robot.sleep_until(float(now))

    def _spend(self, arguments: Sequence[Argument]) -> None:
        limits, longest = self.limits, 0
        for argument in arguments:
            texts = (argument,) if isinstance(argument, str) else [option.text for option in argument]
            longest = max(longest, *map(len, texts), 0)
            self.text += sum(map(len, texts)) + OPTION_OVERHEAD * (len(texts) - 1)
        self.calls += 1
        if self.calls > limits.calls:
            self.limit = f"{limits.calls:,} skill calls"
        elif longest > limits.text:
            self.limit = f"a text of more than {limits.text:,} characters"
        elif self.text > limits.trace:
            self.limit = f"texts of more than {limits.trace:,} characters in all"
