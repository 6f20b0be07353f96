"""Carries out an agent's mission in one world of a task. Each call of a skill becomes a line of a program."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Any

from codebotler.core.errors import UserError
from codebotler.core.skills.table import Skill
from codebotler.core.terminal import shortened
from codebotler.core.trace import Outcome
from codebotler.prompts.tools import GIVE_UP, WAIT
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.ledger import Ledger, judge_end
from codebotler.simulator.skill_protocol import named_arguments
from codebotler.simulator.worlds.robot import Argument
from roboeval.evaluation.recording import RecordingRobot
from roboeval.evaluation.runs.endings import (
    ERROR,
    FINAL_ANSWER,
    GAVE_UP,
    NO_CALL,
    OUTSIDE_CONTRACT,
    REPEATED_CALLS,
    SEVERAL_CALLS,
    TIMEOUT,
    UNKNOWN_TOOL,
    WRONG_ARGUMENTS,
    apply_ending,
)
from roboeval.suites.load import Scenario, Suite

MAX_MISTAKES = 3
"""The number of mistakes in a row after which a mission ends."""

MAX_REPEATS = 100
"""The number of equal calls with equal results after which a mission ends. Waits in between do not count."""

LONGEST_WAIT = 1_000_000
"""The longest time that one call of `wait` may take, in seconds."""

_TASK = "def task_program():\n"


@dataclass
class AgentMission:
    """Executes an agent's calls in one world until the mission ends, and records them as a program.

    Args:
        suite: the suite with the skills, the house rules and the settings of the simulation.
        scenario: the world and its requirements.
        contracts: limits on what the robot may do. A call that violates one ends the mission.
    """

    suite: Suite
    scenario: Scenario
    contracts: Sequence[Contract] = ()
    ending: str | None = None  # one of `ENDINGS`; None before the end
    mistakes: Counter[str] = field(default_factory=Counter)  # also of errors, by kind
    _in_a_row: int = 0  # mistakes
    _same: tuple[object, int] = (None, 0)  # the last call with its result, and how often it was made

    def __post_init__(self) -> None:
        self.robot = RecordingRobot(self.scenario.world, self.suite, contracts=self.contracts)
        self._ledger = Ledger(self.robot)

    def call(self, name: str, arguments: str | Mapping[str, object]) -> str:
        """Call a skill, `wait` or `give_up`. Return the result or error as text. This may end the mission."""
        if self.ending is not None:
            raise UserError("this mission is over, so no call is possible; begin another mission")
        try:
            given = _read(arguments)
            if name in self.suite.skills:
                skill = self.suite.skills[name]
                values = named_arguments(skill, self._lower(given))
            elif name == GIVE_UP:
                return self.give_up(str(given.get("reason", "")))
            elif name == WAIT:
                return self._wait(_read_seconds(given))
            else:
                return self.refuse(UNKNOWN_TOOL, f'there is no tool "{shortened(name)}"', name)
        except UserError as error:
            return self.refuse(WRONG_ARGUMENTS, error.sentence, name)
        text = self._perform(skill, values)
        made, (last, times) = (skill.name, values, text), self._same
        self._same = (made, times + 1 if made == last else 1)
        if self._same[1] >= MAX_REPEATS and self.ending is None:
            self.ending = REPEATED_CALLS
        return text

    def refuse(self, kind: str, sentence: str, what: str) -> str:
        """Count a mistake, add the comment `what`, and return a message. Three in a row end the mission."""
        self.mistakes[kind] += 1
        self._in_a_row += 1
        self._note(f"{kind}: {what}")
        if self._in_a_row >= MAX_MISTAKES:
            self.ending = kind
        return f"{kind}: {sentence}"

    def refuse_several(self, names: Sequence[str]) -> str:
        """Count several calls at once as a mistake, make none of them, and return a message for the agent."""
        return self.refuse(
            SEVERAL_CALLS,
            "the robot does one thing at a time, so none of these calls was made; send one call",
            ", ".join(names),
        )

    def answer(self, text: str) -> None:
        """End the mission, because the agent says that it is done. Add `text` to the program as a comment."""
        self.ending = FINAL_ANSWER if self.robot.skill_calls else NO_CALL
        if text:
            self._note(f"In the end: {text}")

    def end(self, ending: str, why: str = "") -> None:
        """End the mission with one of `ENDINGS`, such as `TurnLimit`. Add the comment `why` to `program`."""
        self.ending = ending
        if why:
            self._note(f"{ending}: {why}")

    def give_up(self, reason: str) -> str:
        """End the mission and return a message. The ending is `GaveUp` (`error` if the last call failed)."""
        at, lines = self.robot.try_at, self.robot.lines
        self.ending = GAVE_UP if at is None else ERROR
        if at is not None:
            lines[at : at + 4] = [lines[at + 1].strip()]  # without `try`
        if reason:
            self._note(f"The agent gives up: {reason}")
        return "the mission is over"

    @property
    def program(self) -> str:
        """The source of a program that repeats the calls so far, with the same effect in this world."""
        lines = self.robot.lines
        needs_time = any("time.sleep(" in line for line in lines)
        is_empty = all(line.startswith("#") for line in lines)
        body = "".join(f"    {line}\n" for line in [*lines, *(["pass"] if is_empty else [])])
        return ("import time\n\n" if needs_time else "") + _TASK + body

    @property
    def outcome(self) -> Outcome:
        """The outcome by which the mission is judged, as if a program had made the calls so far."""
        kind = "robot-error" if self.ending == ERROR else "finished"
        end = {"end": kind, "number": len(self._ledger.errors) - 1}
        outcome = judge_end(self._ledger.outcome_at_end(end), self.robot)
        return apply_ending(outcome, self.ending or FINAL_ANSWER)

    def _perform(self, skill: Skill, values: Sequence[Argument]) -> str:
        self._in_a_row = 0
        match self._ledger.perform(skill.name, values):
            case ("ok", result):
                text = self.robot.result_text(skill.name, values, result)
                return "done" if text == "null" else text
            case ("error", (_, kind, message)):
                self.mistakes[kind] += 1
                return f"{kind}: {message}"
        broken = self._ledger.broken
        kind = TIMEOUT if broken is None else OUTSIDE_CONTRACT if self.robot.is_outside else broken.kind
        self.mistakes[kind] += 1
        self.ending = kind if kind in {TIMEOUT, OUTSIDE_CONTRACT} else ERROR
        return f"the mission is over: {self._ledger.limit}"

    def _wait(self, seconds: float) -> str:
        self._in_a_row = 0
        self._ledger.let_time_pass(self.robot.now + seconds)
        if self._ledger.limit is not None:
            self.ending = TIMEOUT
            return f"the mission is over: {self._ledger.limit}"
        now = self.suite.settings.clock_starts + timedelta(seconds=self.robot.now)
        return f"it is {now:%A %H:%M:%S}"

    def _note(self, text: str) -> None:
        self.robot.lines.append(f"# {shortened(' '.join(text.split()))}")

    def _lower(self, given: Mapping[str, object]) -> Mapping[str, object]:
        """Lower-case texts as the suite does those in programs."""
        if self.suite.settings.literals != "lowercase":
            return given
        return {name: _lowered(value) for name, value in given.items()}


def _lowered(value: object) -> object:
    if isinstance(value, list):
        return [*map(_lowered, value)]
    return value.lower() if isinstance(value, str) else value


def _read(arguments: str | Mapping[str, object]) -> Mapping[str, Any]:
    """Read the arguments of a call. Raise UserError if they are not a JSON object."""
    try:
        given = json.loads(arguments or "{}") if isinstance(arguments, str) else arguments
    except (ValueError, RecursionError):
        given = arguments
    if not isinstance(given, Mapping | None):
        raise UserError('the arguments are not a JSON object; send {"NAME": VALUE, ...}')
    return given or {}


def _read_seconds(given: Mapping[str, object]) -> float:
    seconds = given.get("seconds")
    is_number = isinstance(seconds, int | float) and not isinstance(seconds, bool)
    if not is_number or not 0 <= seconds <= LONGEST_WAIT:  # type: ignore[operator]  # a number
        raise UserError(f"call this tool as wait(seconds: float), with 0 to {LONGEST_WAIT:,} seconds")
    return float(seconds)  # type: ignore[arg-type]  # a number
