"""Serves the skill calls of one program's child, and finds out how the run ended."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from math import inf
from typing import TypeAlias

from codebotler.core.skills.table import Skill
from codebotler.core.skills.values import Scalar
from codebotler.core.trace import Option, Outcome, Status
from codebotler.simulator.ledger import MAX_LINE, STOP, WAITS, Ledger, SkillAnswer, SkillPerformer, too_long
from codebotler.simulator.process.errors import LostProcessError, ProtocolError
from codebotler.simulator.process.exit_status import cause_of_death
from codebotler.simulator.process.isolated_process import IsolatedProcess
from codebotler.simulator.robot import Argument
from codebotler.simulator.sandbox import CPU_SECONDS, LIVE_CPU_SECONDS

Taken: TypeAlias = tuple[str, str, tuple[Scalar, ...], str]  # name, kind, choices if any, and words
Description: TypeAlias = tuple[tuple[str, tuple[Taken, ...]], ...]
OVERRUN = 100  # requests beyond a limit, from `finally` and the like, before a child is ended


class SkillProtocol:
    """One run: answers what a fresh child asks until it ends, and says how it ended."""

    def __init__(self, child: IsolatedProcess, code: bytes, robot: SkillPerformer) -> None:
        self.child, self.robot, self.limits = child, robot, robot.settings.limits
        self.ledger = Ledger(robot)
        self._heard = False
        self._skills = {skill.name: skill for skill in robot.skills.rows}
        child.send((code, described(robot), run_parameters(robot)))

    def outcome(self) -> Outcome:
        """Answer to the end, and say how the run ended."""
        try:
            final = self.talk()
        except TimeoutError:
            self.ledger.limit = WAITS
            final = None
        except ProtocolError as error:
            self.child.end()
            return self.ledger.outcome(
                Status.KILLED, "Crash", f"the program wrote to the sandbox channel: {error}"
            )
        except BaseException:
            with suppress(LostProcessError):  # which would hide what the robot says
                self.child.end()
            raise
        if final is None and self.ledger.limit is None:
            return self._died(self.child.ended())
        self.child.kill()
        self.child.hang_up()
        return self.ledger.ended(final or {})

    def talk(self) -> dict[str, object] | None:
        """Answer what the child asks until it says how it ended; None if it does not say so."""
        overrun = 0
        while (message := self.child.receive()) is not None:
            self._heard = True
            if isinstance(message, dict):
                return message
            match message:
                case [str() as name, list() as values, int() | float() as now]:
                    line = 0
                case [str() as name, list() as values, int() | float() as now, int() as line]:
                    pass  # a live program says where it is, and may lie: it is only shown
                case _:
                    raise ProtocolError("a request is malformed")
            if self.robot.is_live:
                self.robot.line = line if type(line) is int and 0 < line <= MAX_LINE else None
            self.child.send((*self._answer(name, values, now), self.robot.now))
            overrun += self.ledger.limit is not None
            if overrun > OVERRUN:
                return None
        return None

    def _answer(self, name: str, values: list[object], now: float) -> SkillAnswer:
        if self.robot.is_live:
            self.child.reset_patience()
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
                raise ProtocolError("there is no such skill")
        return STOP

    def _died(self, status: int) -> Outcome:
        if not self._heard and not self.child.was_isolated():
            raise LostProcessError("a child ended before it was isolated")
        cause, error = cause_of_death(status, LIVE_CPU_SECONDS if self.robot.is_live else CPU_SECONDS)
        return Outcome(cause, self.robot.trace, error)


def described(robot: SkillPerformer) -> Description:
    """The skills of a robot for a child: the name and the parameters of each."""
    return tuple(
        (skill.name, tuple((p.name, p.kind, p.type.choices, p.words) for p in skill.parameters))
        for skill in robot.skills.rows
    )


def run_parameters(robot: SkillPerformer) -> tuple[int, float, float, bool]:
    """What else a child is told of a run: fuel, simulated seconds, start of its clocks, if it is live."""
    settings = robot.settings
    return settings.limits.ticks, settings.limits.seconds, settings.clock_starts.timestamp(), robot.is_live


def arguments_of(skill: Skill, values: Sequence[object]) -> list[Argument]:
    """What a program gives to a skill, as the robot takes it; a ProtocolError if it is anything else."""
    if len(values) != len(skill.parameters):
        raise ProtocolError("a skill has other parameters")
    arguments: list[Argument] = []
    for parameter, value in zip(skill.parameters, values, strict=True):
        if parameter.is_options and isinstance(value, list):
            arguments.append(tuple(_option(option) for option in value))
        elif not parameter.is_options and parameter.type.fits(value):
            arguments.append(tuple(value) if isinstance(value, list) else value)  # type: ignore[arg-type]  # fits
        else:
            raise ProtocolError("an argument is of another type")
    return arguments


def _option(value: object) -> Option:
    match value:
        case [str(text), bool(is_text)]:
            return Option(text, is_text)
        case _:
            raise ProtocolError("an option is malformed")
