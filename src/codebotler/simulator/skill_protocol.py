"""Answers the skill calls of the child that runs one program, and determines how the run ended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import inf
from typing import TypeAlias

from codebotler.core.errors import UserError
from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import Scalar
from codebotler.core.text.unicode import compose
from codebotler.core.trace import Option, Outcome, Status
from codebotler.simulator.ledger import (
    MAX_LINE,
    STOP,
    WAITS,
    Ledger,
    SkillAnswer,
    SkillPerformer,
    run_parameters,
    too_long,
)
from codebotler.simulator.process.errors import LostProcessError, ProtocolError, cause_of_death
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.sandbox import CPU_SECONDS, LIVE_CPU_SECONDS
from codebotler.simulator.worlds.robot import Argument, Result

ParameterDescription: TypeAlias = tuple[str, str, tuple[Scalar, ...], str]  # name, kind, choices, words
SkillDescriptions: TypeAlias = tuple[tuple[str, tuple[ParameterDescription, ...]], ...]
MAX_ARGUMENT_CHARACTERS = 20_000  # of an agent's call in total, since composing them takes time
OVERRUN = 100  # requests after a limit, such as from `finally`, until the child is killed


class SkillProtocol:
    """Answers the skill calls of a program that runs in an isolated process, until the run ends."""

    def __init__(self, child: IsolatedProcess, code: bytes, robot: SkillPerformer) -> None:
        self.child, self.robot, self.limits = child, robot, robot.settings.limits
        self.ledger = Ledger(robot)
        self._skills = {skill.name: skill for skill in robot.skills.rows}
        child.send((code, describe_skills(robot), run_parameters(robot)))

    def outcome(self) -> Outcome:
        """Answer all requests, and return the outcome of the run."""
        try:
            final = self.talk()
        except TimeoutError:
            self.ledger.limit = WAITS
            final = None
        except ProtocolError as error:
            self.child.end()
            message = f"the program wrote to the sandbox channel: {error}"
            return self.ledger.outcome(Status.KILLED, "Crash", message)
        except BaseException:
            with suppress(LostProcessError):  # it would hide the first error
                self.child.end()
            raise
        if final is None and self.ledger.limit is None:
            seconds = LIVE_CPU_SECONDS if self.robot.is_live else CPU_SECONDS
            cause, fault = cause_of_death(self.child.end_gently(), seconds)
            return Outcome(cause, self.robot.trace, fault)
        self.child.kill()
        self.child.close_channel()
        match final:
            case {"now": float(now)} if self.ledger.limit is None and not self.robot.is_live:
                self.ledger.let_time_pass(now)  # it slept before it failed
        return self.ledger.outcome_at_end(final or {})

    def talk(self) -> dict[str, object] | None:
        """Answer requests until the run ends. Return the process's final message, or None if it has none."""
        if self.child.receive() is None:
            raise LostProcessError("a process exited before it was isolated; memory may have run out")
        overrun = 0
        while (message := self.child.receive()) is not None:
            if isinstance(message, dict):
                return message
            match message:
                case [str() as name, list() as values, int() | float() as now]:
                    line = 0
                case [str() as name, list() as values, int() | float() as now, int() as line]:
                    pass  # from a live program; only for display, since it may be false
                case _:
                    raise ProtocolError("a request is not a list of skill, arguments and time")
            if self.robot.is_live:
                self.robot.line = line if type(line) is int and 0 < line <= MAX_LINE else None
            self.child.send((*self._answer(name, values, now), self.robot.now))
            overrun += self.ledger.limit is not None
            if overrun > OVERRUN:
                return None
        return None

    def _answer(self, name: str, values: list[object], now: float) -> SkillAnswer:
        if self.robot.is_live:
            self.child.restart_wait()
        elif self.ledger.limit is None:
            self.ledger.let_time_pass(now)
        if self.ledger.limit is not None:
            return STOP
        if name in self._skills:
            skill = self._skills[name]
            return self.ledger.perform(skill.name, arguments_of(skill, values))
        match name, values:
            case "sleep", [float(seconds)] if self.robot.is_live and 0 <= seconds < inf:
                self.robot.sleep_until(self.robot.now + seconds)
                return ("ok", None)
            case "wait", _:
                self.ledger.limit = WAITS
            case "too-long", _:
                self.ledger.limit = too_long(self.limits)
            case _:
                raise ProtocolError("a request names a skill that does not exist")
        return STOP


def describe_skills(robot: SkillPerformer) -> SkillDescriptions:
    """Return the name and the parameters of each skill of a robot, to send to a program's process."""
    return tuple(
        (skill.name, tuple((p.name, p.kind, p.type.choices, p.in_words) for p in skill.parameters))
        for skill in robot.skills.rows
    )


def arguments_of(skill: Skill, values: Sequence[object]) -> list[Argument]:
    """Convert a call's arguments for the robot. Raise ProtocolError if they do not fit the skill."""
    given, expected = len(values), len(skill.parameters)
    if given != expected:
        raise ProtocolError(f"{skill.name} got {given} arguments, but has {expected} parameters")
    arguments: list[Argument] = []
    for parameter, value in zip(skill.parameters, values, strict=True):
        if parameter.is_options and isinstance(value, list):
            arguments.append(tuple(_option(option) for option in value))
        elif not parameter.is_options and parameter.type.fits(value):
            arguments.append(tuple(value) if isinstance(value, list) else value)  # type: ignore[arg-type]  # `fits` has checked its type
        else:
            raise ProtocolError(f"an argument of {skill.name} has the wrong type")
    return arguments


def _option(value: object) -> Option:
    match value:
        case [str(text), bool(is_text)]:
            return Option(text, is_text)
        case _:
            raise ProtocolError("an option of a question is not a pair of text and boolean")


def named_arguments(skill: Skill, given: Mapping[str, object]) -> list[Argument]:
    """Convert an agent's arguments, given by name, for the robot. Raise UserError if they do not fit."""
    if len(str(given)) > MAX_ARGUMENT_CHARACTERS:
        raise UserError(f"the arguments have more than {MAX_ARGUMENT_CHARACTERS:,} characters; shorten them")
    values = [compose(given.get(parameter.name)) for parameter in skill.parameters]
    for number, parameter in enumerate(skill.parameters):
        if parameter.is_options and isinstance(options := values[number], list):
            values[number] = [[str(one), isinstance(one, str)] for one in options]
    with suppress(ProtocolError):
        if {*given} == {parameter.name for parameter in skill.parameters}:
            return arguments_of(skill, values)
    raise UserError(f"the arguments do not fit; call the skill as {skill.signature}")


def named_result(skill: Skill, arguments: Sequence[Argument], result: Result) -> Result:
    """Return a result as agents see it: for a question, the text of the chosen option, not its position."""
    asked = zip(skill.parameters, arguments, strict=True)
    options = next((one for parameter, one in asked if parameter.is_options), None)
    chosen = options[result] if isinstance(options, tuple) and isinstance(result, int) else result
    return chosen.text if isinstance(chosen, Option) else chosen
