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
from codebotler.checking.contracts.file import contract_yaml
from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import UserError
from codebotler.core.skills.table import Skill, SkillTable
from codebotler.core.terminal import visible
from codebotler.core.text.words import listed
from codebotler.core.trace import Outcome
from codebotler.missions.live import LiveRobot
from codebotler.missions.mission import MissionError
from codebotler.simulator.guard.contract import TELLING_SKILLS, Contract
from codebotler.simulator.ledger import Ledger
from codebotler.simulator.skill_protocol import named_arguments, named_result
from codebotler.simulator.worlds.robot import Argument

IDLE_POLL_SECONDS = 0.1
"""The interval at which an idle mission looks whether it was stopped."""

MAX_STEPS = 10_000
"""The limit for the calls of one mission, since people and reports read its events."""

NOT_RUNNING = "this mission is not running; call run_mission first, or begin_steps for a new one"
_PROGRAM = """# Proposal {mark}
# Step by step: an agent chooses each call after it has seen the result of the last one.
# It says: {purpose}
# The check cannot foresee the calls, but each is compared with this contract and with the house rules:
{contract}
def task_program():
    pass
"""
_Call: TypeAlias = tuple[Skill, list[Argument], "Future[SkillOutcome]"]


@dataclass
class Steps:
    """A step-by-step mission: an agent queues skill calls, and the mission's thread executes them."""

    purpose: str  # in the agent's words
    contract: Contract  # what it may call
    skills: SkillTable
    key: str = field(default_factory=lambda: secrets.token_urlsafe(12))  # so that agents are not mixed up
    mark: str = field(default_factory=lambda: secrets.token_hex(8))  # no other program has the same text
    _calls: Queue[_Call | None] = field(default_factory=Queue)  # None ends the mission
    _is_over: bool = False
    _lock: Lock = field(default_factory=Lock)

    @cached_property
    def program(self) -> str:
        """The text that a person approves in place of a program: the purpose and the contract."""
        contract = contract_yaml(self.contract).splitlines()
        purpose = visible(" ".join(self.purpose.split()))
        lines = "\n".join(f"#   {line}" for line in contract)
        return _PROGRAM.format(mark=self.mark, purpose=purpose, contract=lines)

    def call(self, name: str, arguments: Mapping[str, object]) -> Future[SkillOutcome]:
        """Queue a skill call and return its future. Raise UserError if the call is invalid or not allowed."""
        if name not in (self.contract.skills.keys() | TELLING_SKILLS) & {*self.skills}:
            raise UserError(f"this mission may call only {listed(list(self.contract.skills))}")
        call = self.skills[name], named_arguments(self.skills[name], arguments), Future[SkillOutcome]()
        with self._lock:
            if self._is_over:
                raise MissionError(NOT_RUNNING)
            self._calls.put(call)
        return call[2]

    def end(self) -> None:
        """End the mission once all queued calls are done."""
        self._calls.put(None)

    def drive(self, live: LiveRobot) -> Outcome:
        """Execute queued calls on the mission's thread until `end` or a stop, and return the outcome."""
        ledger, call = Ledger(live), None
        try:
            while ledger.limit is None and (call := self._next(live)) is not None:
                call[2].set_result(_perform(ledger, *call[:2]))
                if ledger.calls >= MAX_STEPS:
                    ledger.limit = f"the mission has made {MAX_STEPS:,} calls; begin another mission"
            return ledger.outcome_at_end({"end": "finished"})
        finally:
            self._close(call)

    def _next(self, live: LiveRobot) -> _Call | None:
        while True:
            live.check_end()
            try:
                return self._calls.get(timeout=IDLE_POLL_SECONDS)
            except Empty:
                continue

    def _close(self, call: _Call | None) -> None:
        """Answer the current call and all that wait."""
        with self._lock:
            self._is_over = True
            while call is not None or not self._calls.empty():
                if call is not None and not call[2].done():
                    call[2].set_exception(MissionError("the mission ended before this call was finished"))
                call = None if self._calls.empty() else self._calls.get()


def _perform(ledger: Ledger, skill: Skill, arguments: Sequence[Argument]) -> SkillOutcome:
    match ledger.perform(skill.name, arguments):
        case ("ok", result):
            return SkillOutcome(result=named_result(skill, arguments, result))
        case ("error", (_, kind, message)):
            return SkillOutcome(error=f"{kind}: {message}")
        case _:
            return SkillOutcome(error=ledger.limit or "the mission has ended")
