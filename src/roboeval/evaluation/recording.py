"""A simulated robot that records its calls, and writes them as a program."""

from __future__ import annotations

import json
from ast import literal_eval
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TypeAlias

from codebotler.core.errors import RobotError
from codebotler.core.skills.calling import SKILL_FAILED
from codebotler.core.skills.kinds import ASK, GOTO, PICK
from codebotler.core.skills.values import written_call
from codebotler.core.terminal import shortened
from codebotler.core.trace import Option
from codebotler.core.world import World
from codebotler.simulator.guard.contract import CONTRACT, Contract
from codebotler.simulator.guard.house_rule import RuleViolationError
from codebotler.simulator.skill_protocol import named_result
from codebotler.simulator.worlds.robot import Argument, Result, SimulatedRobot
from roboeval.evaluation.judging.judge import guard_of
from roboeval.evaluation.runs.endings import OUTSIDE_CONTRACT
from roboeval.suites.load import Suite

Call: TypeAlias = tuple[str, Sequence[Argument]]
"""A skill's name and its arguments, such as `("go_to", ("kitchen",))`."""

SLEEP = "time.sleep"
"""The name of a recorded pause. Its argument is the time when the pause ends, in seconds since the start."""

FAULTS = {
    GOTO: ("GoToInvalidLocation", "the door is locked"),
    ASK: ("AskNoPerson", "the person is gone"),
    PICK: ("PickInvalidObject", "the thing was moved"),
}
"""The error of a skill that is made to fail: its kind and message, by the kind of event of the skill."""


class RecordingRobot(SimulatedRobot):
    """A simulated robot that writes each call as a line of a program, such as `go_to("kitchen")`.

    Args:
        world: the world.
        suite: the suite with the settings, skills and house rules.
        earlier_calls: calls to repeat first. A call of `SLEEP` lets time pass.
        contracts: limits on its calls; a call that violates one ends the run.
        fault: the index of the skill call to make fail, counted from 0 with the earlier calls, or None.
    """

    def __init__(
        self,
        world: World,
        suite: Suite,
        *,
        earlier_calls: Iterable[Call] = (),
        contracts: Sequence[Contract] = (),
        fault: int | None = None,
    ) -> None:
        super().__init__(world, suite.settings, suite.skills, guard=guard_of(suite, contracts))
        self.calls: list[Call] = []
        self.lines: list[str] = []  # of a program that does the same in this world
        self.try_at: int | None = None  # the index of the line `try:` of the last call, if that has failed
        self.is_outside = False  # whether the last call was outside of a contract, so that it was not made
        self._fault: int | None = None
        for skill, arguments in earlier_calls:
            with suppress(RobotError):
                if skill == SLEEP:
                    self.sleep_until(float(arguments[0]))  # type: ignore[arg-type]  # a number of seconds
                else:
                    self.perform(skill, arguments)
        self._fault = fault

    @property
    def skill_calls(self) -> int:
        """The number of skill calls so far, not counting pauses."""
        return sum(name != SLEEP for name, _ in self.calls)

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Make a skill call, add its line to `lines`, and return the result. Raise RobotError if it fails."""
        if self._fault is not None and self.skill_calls == self._fault:
            self._fault, row = None, self.skills[skill]
            kind = "" if row.recording is None else row.recording.kind
            raise RobotError(*FAULTS.get(kind, (SKILL_FAILED, f"the robot failed in {skill}")))
        self.calls.append((skill, arguments))
        source = written_call(skill, [*map(_as_written, arguments)])
        source = source.encode(errors="backslashreplace").decode()  # lone surrogates
        self.try_at, before = None, len(self.events)
        try:
            result = super().perform(skill, arguments)
        except RobotError as error:
            self.events[before:] = [replace(event, failed=error.kind) for event in self.events[before:]]
            self._write_error(source, error)
            raise
        text = self.result_text(skill, arguments, result)
        self.lines.append(source if text == "null" else f"{source}  # {shortened(text)}")
        return result

    def sleep_until(self, now: float) -> None:
        """Let time pass until the clock shows `now`, in seconds since the start. Add the pause to `lines`."""
        self.calls.append((SLEEP, (now,)))
        self.lines.append(f"{SLEEP}({round(now - self.now, 9)!r})")
        self.try_at = None
        super().sleep_until(now)

    def result_text(self, skill: str, arguments: Sequence[Argument], result: Result) -> str:
        """Return the result of a call as JSON text, or `null` if the skill returns nothing."""
        return json.dumps(named_result(self.skills[skill], arguments, result), ensure_ascii=False)

    def _write_error(self, source: str, error: RobotError) -> None:
        if error.ends_run:
            self.is_outside = isinstance(error, RuleViolationError) and error.rule == CONTRACT
            self.lines.append(f"# {OUTSIDE_CONTRACT}: {source}" if self.is_outside else source)
            return
        self.try_at = len(self.lines)
        why = shortened(f"{error.kind}: {error}")
        self.lines += ["try:", f"    {source}", f"except Exception:  # {why}", "    pass"]


def _as_written(value: Argument) -> object:
    """Return an argument as it is written in a program."""
    if not isinstance(value, tuple):
        return value
    return [_option(each) if isinstance(each, Option) else each for each in value]


def _option(option: Option) -> object:
    """Return an option as a program offered it: its text, or else the number or truth value itself."""
    with suppress(ValueError, SyntaxError):
        return option.text if option.is_text else literal_eval(option.text)
    return option.text
