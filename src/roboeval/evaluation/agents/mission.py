"""One mission of an agent, which calls skills in one world of a task; each call becomes a line of source."""

from __future__ import annotations

import builtins
import json
from ast import literal_eval
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import timedelta
from typing import Any, Self

from codebotler.core.errors import UserError
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import written_call
from codebotler.core.terminal import shortened
from codebotler.core.trace import Option, Outcome
from codebotler.prompts.tools import GIVE_UP, WAIT
from codebotler.simulator.contract import CONTRACT, Contract
from codebotler.simulator.house_rule import RuleViolationError
from codebotler.simulator.ledger import Ledger, judge_end
from codebotler.simulator.robot import Argument
from codebotler.simulator.skill_protocol import named_arguments, named_result
from roboeval.evaluation.judge import robot_in
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
"""The number of equal calls with equal results after which a mission ends. Nobody is waited for that long."""

LONGEST_WAIT = 1_000_000
"""The longest time that one call waits."""

_TASK = "def task_program():\n"


@dataclass
class AgentMission:
    """What an agent does in one world, until the mission ends.

    Args:
        suite: the suite with the skills, the house rules and the settings of the simulation.
        scenario: the world, and what is required there.
        contracts: what the robot may do at most. A call outside of them ends the mission.
    """

    suite: Suite
    scenario: Scenario
    contracts: Sequence[Contract] = ()
    ending: str | None = None  # one of `ENDINGS`; None before the end
    mistakes: Counter[str] = field(default_factory=Counter)  # and errors of the robot, by kind
    _lines: list[str] = field(default_factory=list)  # of the program
    _in_a_row: int = 0  # mistakes
    _same: tuple[object, int] = (None, 0)  # the last call with its result, and how often it was made
    _raised: tuple[str, str] | None = None  # the kind and the message of a program's Python error
    _error: tuple[int, int] | None = None  # of the last call, if it failed: the error's number, and its line

    def __post_init__(self) -> None:
        self._robot = robot_in(self.scenario.world, self.suite, self.contracts)
        self._ledger = Ledger(self._robot)

    @classmethod
    def begin(
        cls, suite: Suite, task: str, prompt: int, world: int, contracts: Sequence[Contract] = ()
    ) -> Self:
        """Begin a mission for a prompt of a task, in the world with this index."""
        return cls(suite, suite.task(task).scenarios[world].asked_by(prompt), contracts)

    def call(self, name: str, arguments: str | Mapping[str, object]) -> str:
        """Make one call, and return what the agent is told. The call may end the mission."""
        if self.ending is not None:
            raise UserError("this mission is over")
        try:
            given = _read(arguments)
            if name in self.suite.skills:
                skill = self.suite.skills[name]
                values = named_arguments(skill, self._lower(given))
            elif name == GIVE_UP:
                return self._give_up(str(given.get("reason", "")))
            elif name == WAIT:
                return self._wait(_read_seconds(given))
            else:
                return self.refuse(UNKNOWN_TOOL, f'there is no tool "{shortened(name)}"', name)
        except UserError as error:
            return self.refuse(WRONG_ARGUMENTS, error.sentence, name)
        text = self._perform(skill, values, [given[parameter.name] for parameter in skill.parameters])
        self._watch_repeats((skill.name, values, text))
        return text

    def refuse(self, kind: str, sentence: str, what: str) -> str:
        """Count a mistake, of which too many in a row end the mission, and return what the agent is told."""
        self.mistakes[kind] += 1
        self._in_a_row += 1
        self._note(f"{kind}: {what}")
        if self._in_a_row >= MAX_MISTAKES:
            self.ending = kind
        return f"{kind}: {sentence}"

    def refuse_several(self, names: Sequence[str]) -> str:
        """Count several calls at once as a mistake. None of them is made."""
        return self.refuse(
            SEVERAL_CALLS,
            "the robot does one thing at a time, so none of these calls was made; send one call",
            ", ".join(names),
        )

    def answer(self, text: str) -> None:
        """End the mission with the agent's last words."""
        self.ending = FINAL_ANSWER if self._ledger.calls else NO_CALL
        if text:
            self._note(f"In the end: {text}")

    def end(self, ending: str, why: str = "") -> None:
        """End the mission for a reason outside of it."""
        self.ending = ending
        if why:
            self._note(f"{ending}: {why}")

    def crash(self, kind: str, message: str) -> None:
        """End the mission with a Python error of a program that made its calls."""
        self._raised = kind, message
        self._lines.append(f"raise {kind if _is_raised_with_text(kind) else 'Exception'}({message!r})")
        self.ending = ERROR

    def repeat(self, skill: Skill, values: Sequence[Argument]) -> None:
        """Make a call that a program made."""
        if self.ending is None:
            self._perform(skill, values, [_written(value) for value in values])

    @property
    def program(self) -> str:
        """The calls as a program, which does the same in this world."""
        needs_time = any("time.sleep(" in line for line in self._lines)
        is_empty = all(line.startswith("#") for line in self._lines)
        lines = [*self._lines, *(["pass"] if is_empty else [])]
        return ("import time\n\n" if needs_time else "") + _TASK + "".join(f"    {line}\n" for line in lines)

    @property
    def outcome(self) -> Outcome:
        """The outcome so far, which is that of the program."""
        end: dict[str, object] = {"end": "finished"}
        if self._error is not None and self.ending == ERROR:
            end = {"end": "robot-error", "number": self._error[0]}
        elif self._raised is not None:
            end = {"end": "python-error", "kind": self._raised[0], "message": self._raised[1]}
        return apply_ending(
            judge_end(self._ledger.outcome_at_end(end), self._robot), self.ending or FINAL_ANSWER
        )

    def _perform(self, skill: Skill, values: Sequence[Argument], given: Sequence[object]) -> str:
        source = written_call(skill.name, given).encode(errors="backslashreplace").decode()  # lone surrogates
        self._error, self._in_a_row = None, 0
        match self._ledger.perform(skill.name, values):
            case ("ok", result):
                told = json.dumps(named_result(skill, values, result), ensure_ascii=False)
                self._lines.append(source if told == "null" else f"{source}  # {shortened(told)}")
                text = "done" if told == "null" else told
            case ("error", (number, kind, message)):
                text = f"{kind}: {message}"
                self.mistakes[kind] += 1
                self._error = number, len(self._lines)
                self._lines += [
                    "try:",
                    f"    {source}",
                    f"except Exception:  # {shortened(text)}",
                    "    pass",
                ]
            case _:
                broken = self._ledger.broken
                is_outside = isinstance(broken, RuleViolationError) and broken.rule == CONTRACT
                self._lines.append(f"# {OUTSIDE_CONTRACT}: {source}" if is_outside else source)
                kind = TIMEOUT if broken is None else OUTSIDE_CONTRACT if is_outside else broken.kind
                self.mistakes[kind] += 1
                self.ending = kind if kind in {TIMEOUT, OUTSIDE_CONTRACT} else ERROR
                return f"the mission is over: {self._ledger.limit}"
        return text

    def _watch_repeats(self, call: object) -> None:
        last, times = self._same
        self._same = (call, times + 1 if call == last else 1)
        if self._same[1] >= MAX_REPEATS and self.ending is None:
            self.ending = REPEATED_CALLS

    def sleep_until(self, now: float) -> None:
        """Let time pass until `now` seconds since the start, as a program did."""
        if self.ending is None:
            self._wait(max(0.0, now - self._robot.now))

    def _wait(self, seconds: float) -> str:
        self._in_a_row, self._error = 0, None
        seconds = min(seconds, self._ledger.limits.seconds)
        self._ledger.let_time_pass(self._robot.now + seconds)
        self._lines.append(f"time.sleep({seconds!r})")
        if self._ledger.limit is not None:
            self.ending = TIMEOUT
            return f"the mission is over: {self._ledger.limit}"
        now = self.suite.settings.clock_starts + timedelta(seconds=self._robot.now)
        return f"it is {now:%A %H:%M:%S}"

    def _give_up(self, reason: str) -> str:
        """End the mission: with the robot's error if the last call failed, since that is the cause."""
        self.ending = GAVE_UP if self._error is None else ERROR
        if self._error is not None:
            at = self._error[1]
            self._lines[at : at + 4] = [self._lines[at + 1].strip()]  # without `try`
        if reason:
            self._note(f"The agent gives up: {reason}")
        return "the mission is over"

    def _note(self, text: str) -> None:
        self._lines.append(f"# {shortened(' '.join(text.split()))}")

    def _lower(self, given: Mapping[str, object]) -> Mapping[str, object]:
        """Lower-case texts as the suite does those in programs."""
        if self.suite.settings.literals != "lowercase":
            return given
        return {name: _lowered(value) for name, value in given.items()}


def _is_raised_with_text(kind: str) -> bool:
    """Whether a kind is a built-in exception that takes one text."""
    known = getattr(builtins, kind, None)
    try:
        return isinstance(known, type) and issubclass(known, Exception) and str(known("text")) != ""
    except TypeError:
        return False


def _written(value: Argument) -> object:
    """Return an argument as it is written in a program."""
    if not isinstance(value, tuple):
        return value
    return [_option(each) if isinstance(each, Option) else each for each in value]


def _option(option: Option) -> object:
    """Return an option as a program offered it: its text, or else the number or truth value itself."""
    with suppress(ValueError, SyntaxError):
        return option.text if option.is_text else literal_eval(option.text)
    return option.text


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
        raise UserError("the arguments are not a JSON object")
    return given or {}


def _read_seconds(given: Mapping[str, object]) -> float:
    seconds = given.get("seconds")
    is_number = isinstance(seconds, int | float) and not isinstance(seconds, bool)
    if not is_number or not 0 <= seconds <= LONGEST_WAIT:  # type: ignore[operator]  # a number
        raise UserError(f"call it as wait(seconds: float), with 0 to {LONGEST_WAIT:,} seconds")
    return float(seconds)  # type: ignore[arg-type]  # a number
