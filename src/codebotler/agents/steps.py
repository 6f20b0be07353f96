"""`Steps`: a mission without a program, in which an agent calls one skill after another."""

from __future__ import annotations

import secrets
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from queue import Empty, Queue
from threading import Lock
from typing import TypeAlias

from codebotler.agents.reports import SkillOutcome
from codebotler.core.errors import UserError
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.terminal import visible
from codebotler.core.trace import Outcome
from codebotler.core.unicode import compose
from codebotler.core.words import listed
from codebotler.missions.live import LiveRobot
from codebotler.missions.mission import MissionError
from codebotler.simulator.ledger import Ledger
from codebotler.simulator.process.errors import ProtocolError
from codebotler.simulator.robot import Argument
from codebotler.simulator.skill_protocol import arguments_of

IDLE_POLL_SECONDS = 0.1
"""How often an idle mission looks whether it was stopped."""

NOT_RUNNING = "this mission is not running; call run_mission first, or begin_steps for a new one"

_PROGRAM = """# Step by step: an agent chooses each call after it has seen the result of the last one.
# The check cannot foresee the calls; house rules apply to each.
# It may call only: {skills}
# It says: {purpose}
def task_program():
    pass
"""
_Call: TypeAlias = tuple[Skill, list[Argument], "Future[SkillOutcome]"]


@dataclass
class Steps:
    """Hands an agent's calls to the thread of its mission, one at a time.

    Args:
        purpose: the purpose in the agent's words.
        skills: the skills that it may call.
    """

    purpose: str
    skills: SkillTable
    key: str = field(default_factory=lambda: secrets.token_urlsafe(12))  # so that agents are not mixed up
    _calls: Queue[_Call | None] = field(default_factory=Queue)
    _is_over: bool = False
    _lock: Lock = field(default_factory=Lock)

    @property
    def program(self) -> str:
        """The text that a person approves in place of a program."""
        return _PROGRAM.format(skills=", ".join(self.skills), purpose=visible(" ".join(self.purpose.split())))

    def call(self, name: str, arguments: Mapping[str, object]) -> Future[SkillOutcome]:
        """Call a skill of the running mission. Raise UserError for a wrong call."""
        if name not in self.skills:
            raise UserError(
                f"this mission has no skill {name}; it may call {listed(list(self.skills), 'or')}"
            )
        skill, called = self.skills[name], Future[SkillOutcome]()
        given = _arguments(skill, arguments)
        with self._lock:
            if self._is_over:
                raise MissionError(NOT_RUNNING)
            self._calls.put((skill, given, called))
        return called

    def end(self) -> None:
        """End the mission after the calls so far."""
        self._calls.put(None)

    def drive(self, live: LiveRobot) -> Outcome:
        """Execute the calls on the mission's thread until `end`, or until the mission is stopped."""
        ledger = Ledger(live)
        try:
            while (call := self._next(live)) is not None:
                _execute(ledger, *call)
                if ledger.limit is not None:
                    break
            return ledger.outcome_at_end({"end": "finished"})
        finally:
            self._close()

    def _next(self, live: LiveRobot) -> _Call | None:
        while True:
            live.check_end()
            try:
                return self._calls.get(timeout=IDLE_POLL_SECONDS)
            except Empty:
                continue

    def _close(self) -> None:
        with self._lock:
            self._is_over = True
            while not self._calls.empty():
                if (call := self._calls.get()) is not None:
                    call[2].set_exception(MissionError("the mission ended before this call"))


def _execute(
    ledger: Ledger, skill: Skill, arguments: Sequence[Argument], called: Future[SkillOutcome]
) -> None:
    try:
        answer = ledger.perform(skill.name, arguments)
    except BaseException:
        called.set_exception(MissionError("the mission ended during this call"))
        raise
    match answer:
        case ("ok", result):
            called.set_result(SkillOutcome(result=_plain(skill, arguments, result)))  # type: ignore[arg-type]  # a result of a skill
        case ("error", (_, kind, message)):
            called.set_result(SkillOutcome(error=f"{kind}: {message}"))
        case _:
            called.set_exception(MissionError(ledger.limit or "the mission ended during this call"))


def _plain(skill: Skill, arguments: Sequence[Argument], result: object) -> object:
    """Replace the position of a chosen option by its text."""
    offered = [
        one for parameter, one in zip(skill.parameters, arguments, strict=True) if parameter.is_options
    ]
    if offered and isinstance(offered[0], tuple) and type(result) is int:
        return getattr(offered[0][result], "text", result)
    return result


def _arguments(skill: Skill, given: Mapping[str, object]) -> list[Argument]:
    names = [parameter.name for parameter in skill.parameters]
    if {*given} != {*names}:
        raise UserError(f"{skill.signature} takes {listed(names) or 'no arguments'}")
    values: list[object] = []
    for parameter in skill.parameters:
        value = given[parameter.name]
        if parameter.is_options and isinstance(value, list):
            values.append([[compose(str(one)), isinstance(one, str)] for one in value])
        elif isinstance(value, list):
            values.append([compose(one) if isinstance(one, str) else one for one in value])
        else:
            values.append(compose(value) if isinstance(value, str) else value)
    try:
        return arguments_of(skill, values)
    except ProtocolError:
        words = ", ".join(f"{one.name}: {one.words}" for one in skill.parameters)
        raise UserError(f"{skill.name} takes {words}") from None
