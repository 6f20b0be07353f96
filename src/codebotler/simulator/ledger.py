"""Counts the requests of one run to its robot, and ends the run when it reaches a limit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import VIOLATION, RobotError
from codebotler.core.skills.table import SkillTable
from codebotler.core.trace import Event, Option, Outcome, RunError, Status, Trace
from codebotler.simulator.settings import Limits, SimulationSettings
from codebotler.simulator.worlds.robot import Argument, Result, SimulatedRobot

UNREMEMBERED_CALLS = 50  # calls of a run before answers are cached
OPTION_OVERHEAD = 10  # characters counted for each option, since even an empty one takes memory
WAITS = "a wait for something that can never happen"
MAX_LINE = 1_000_000
MAX_MESSAGE = 1_000  # characters, since a robot's error may quote a whole request
SkillAnswer: TypeAlias = tuple[str, Any]
"""`ok` and the result, `error` and (number, kind, message), or `stop` and True if a rule ended the run."""
STOP: SkillAnswer = ("stop", None)
STOPPED_BY_RULE: SkillAnswer = ("stop", True)


class SkillPerformer(Protocol):
    """A simulated or real robot that performs the skill calls of a run. Calls have no time limit."""

    settings: SimulationSettings
    skills: SkillTable
    is_live: bool  # whether time is real and each skill refuels the program
    line: int | None  # the line of a live program's current request

    @property
    def now(self) -> float:
        """The time on the program's clock, in seconds since the start of the run."""

    @property
    def trace(self) -> Trace:
        """The robot's trace so far."""

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute one skill, and return its result. Raise RobotError if the skill fails."""

    def sleep_until(self, now: float) -> None:
        """Let time pass until the clock shows `now`, in seconds since the start, or the robot is stopped."""


def run_parameters(robot: SkillPerformer) -> tuple[int, float, float, float, bool]:
    """Return step limit, seconds so far, time limit (seconds), clock start (Unix time), if time is real."""
    settings, limits = robot.settings, robot.settings.limits
    return limits.ticks, robot.now, limits.seconds, settings.clock_starts.timestamp(), robot.is_live


class Ledger:
    """Passes the skill calls of one run to the robot, counts them, and ends the run at a limit."""

    def __init__(self, robot: SkillPerformer) -> None:
        self.robot, self.limits = robot, robot.settings.limits
        self.calls = self.text = 0  # number of calls, and characters of all texts
        self.limit: str | None = None  # the limit that was reached, in words
        self.errors: list[RobotError] = []
        self.broken: RobotError | None = None  # the error of the rule that ended the run

    def perform(self, skill: str, arguments: Sequence[Argument]) -> SkillAnswer:
        """Let the robot execute one skill and return its answer, or return `STOP` if a limit is reached."""
        self._spend(arguments)
        if self.limit is not None:
            return STOP
        try:
            result = self.robot.perform(skill, arguments)
        except RobotError as error:
            if error.ends_run:
                self.broken, self.limit = error, str(error)
                return STOPPED_BY_RULE
            self.errors.append(error)
            return ("error", (len(self.errors) - 1, error.kind, str(error)))
        return ("ok", result)

    def let_time_pass(self, now: float) -> None:
        """Advance simulated time to `now` seconds since the start, or to its limit, which ends the run."""
        if now > self.limits.seconds:
            now = self.limits.seconds
            self.limit = f"{self.limits.seconds:,.0f} seconds of simulated time"
        if now > self.robot.now:  # only a program that found the channel can send an earlier time
            self.robot.sleep_until(float(now))

    def outcome_at_end(self, final: Mapping[str, object]) -> Outcome:
        """Return the outcome of a run, given the last message (`final`) of its process."""
        line = final.get("line")
        if self.limit is not None:
            status = Status.TIMEOUT if self.broken is None else Status.ROBOT_ERROR
            return self.outcome(status, getattr(self.broken, "kind", "TimeoutError"), self.limit, line)
        match final:
            case {"end": "finished"}:
                return Outcome(Status.FINISHED, self.robot.trace)
            case {"end": "timeout"}:
                limit = f"{self.limits.ticks:,} loop iterations and function calls"
                return self.outcome(Status.TIMEOUT, "TimeoutError", limit, line)
            case {"end": "robot-error", "number": int(number)} if 0 <= number < len(self.errors):
                error = self.errors[number]
                return self.outcome(Status.ROBOT_ERROR, error.kind, str(error), line)
            case {"end": "python-error", "kind": str(kind), "message": str(message)}:
                is_own = kind.isidentifier() and kind != VIOLATION  # reserved for rules
                name = kind if is_own else "Exception"
                return self.outcome(Status.PYTHON_ERROR, name[:100], message, line)
            case _:
                return self.outcome(Status.KILLED, "Crash", "the program wrote to the sandbox channel")

    def outcome(self, status: Status, kind: str, message: str, line: object = None) -> Outcome:
        """Return the outcome of a run that ended with an error, at `line` if that is a valid line number."""
        where = line if type(line) is int and 0 < line <= MAX_LINE else None
        return Outcome(status, self.robot.trace, RunError(kind, message[:MAX_MESSAGE]), where)

    def _spend(self, arguments: Sequence[Argument]) -> None:
        limits, longest = self.limits, 0
        for argument in arguments:
            if isinstance(argument, str):
                texts: Sequence[str] = (argument,)
            elif isinstance(argument, tuple):
                texts = [each.text if isinstance(each, Option) else str(each) for each in argument]
            else:
                continue
            sizes = list(map(len, texts))
            self.text += sum(sizes) + OPTION_OVERHEAD * (len(texts) - 1)
            longest = max([longest, *sizes])
        self.calls += 1
        if self.calls > limits.calls:
            self.limit = f"{limits.calls:,} skill calls"
        elif longest > limits.text:
            self.limit = too_long(limits)
        elif self.text > limits.trace:
            self.limit = f"texts of more than {limits.trace:,} characters in total"


def judge_end(outcome: Outcome, robot: SimulatedRobot) -> Outcome:
    """Return the outcome, or a robot error if the program finished without satisfying every house rule."""
    unkept = robot.guard.find_first_unkept() if robot.guard is not None and outcome.error is None else None
    if unkept is None:
        return outcome
    return Outcome(Status.ROBOT_ERROR, outcome.trace, RunError(unkept.kind, str(unkept)))


def too_long(limits: Limits) -> str:
    """Return a phrase about the limit on a text's length: "a text of more than 50 characters"."""
    return f"a text of more than {limits.text:,} characters"


class RememberingLedger(Ledger):
    """Counts the calls of a simulated run, and caches the answers to calls that change nothing.

    This speeds up programs that wait by looking a thousand times. Caching starts after UNREMEMBERED_CALLS.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        super().__init__(robot)
        self._simulated = robot
        self._same: dict[tuple[object, ...], tuple[int, SkillAnswer, Sequence[Event]]] = {}

    @cached_property
    def _idle(self) -> frozenset[str]:
        if self._simulated.guard is not None:  # the guard must see each event
            return frozenset()
        return self._simulated.idle_skills.difference(self._simulated.own_skills)

    def perform(self, skill: str, arguments: Sequence[Argument]) -> SkillAnswer:
        """Let the robot execute one skill, or return the cached answer to an identical call."""
        robot = self._simulated
        if self.calls < UNREMEMBERED_CALLS or skill not in self._idle:
            self._same.clear()
            return super().perform(skill, arguments)
        call = (skill, *arguments)
        if call in self._same:
            text, answer, events = self._same[call]
            if self.calls < self.limits.calls and self.text + text <= self.limits.trace:
                self.calls += 1
                self.text += text
                robot.repeat(events)
                return answer
        text, before = self.text, len(robot.events)
        answer = super().perform(skill, arguments)
        if answer[0] == "ok":
            self._same[call] = self.text - text, answer, robot.events[before:]
        return answer
