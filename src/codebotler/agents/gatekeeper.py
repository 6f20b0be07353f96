"""`Gatekeeper`: takes proposals from agents, which a person or a contract must approve."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from secrets import compare_digest
from threading import Thread
from typing import Any, TypeVar

from codebotler.agents.reports import CheckReport, MissionReport, RobotReport, report_check
from codebotler.agents.steps import NOT_RUNNING, Steps
from codebotler.checking.contracts.file import contract_from
from codebotler.checking.contracts.text import contract_sentence
from codebotler.checking.problems import CheckResult
from codebotler.core.errors import UserError
from codebotler.core.program import MAX_PROGRAM_LENGTH
from codebotler.core.text.words import brief_part
from codebotler.missions.authoring import ModelAuthor
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.display.wording import event_text
from codebotler.missions.mission import MissionError
from codebotler.missions.preflight import missing_skills
from codebotler.missions.session import MissionSession
from codebotler.missions.storage.log import MissionState
from codebotler.models.base import ignore_text
from codebotler.prompts import Prompt, prompt_for
from codebotler.simulator.guard.contract import Contract
from codebotler.web.console import Console

_Made = TypeVar("_Made")
MAX_CONTRACT_CHARACTERS = 16_000  # a check reads no program of more than 20,000
TOO_LONG = f"the contract is longer than {MAX_CONTRACT_CHARACTERS:,} characters; shorten it"
MAX_REPORTED_EVENTS = 1_000  # in one report
READING_PAST = "reading of missions"  # a kind of work
MAX_WAITING_CALLS = 100  # each event wakes all of them
MAX_ASKED_PROBLEMS = 20  # in a client's dialog; more are reviewed on the page
MAX_ASKED_CHARACTERS = 4_000
"""The limit for a program and for its contract in a client's dialog. Longer ones are reviewed on the page."""


@dataclass
class Gatekeeper:
    """Checks the requests of agents, and passes them to the page's console. No method approves a mission.

    Args:
        console: the robot and its current mission.
        asks_client: whether clients may show dialogs; False if something other than a person might answer.
        writes: whether a model is configured that can write programs.
        page: the address of the page, without its token; empty before it is served.
    """

    console: Console
    asks_client: bool = False
    writes: bool = False
    page: str = ""
    _session: MissionSession | None = field(default=None, init=False)  # the latest one of an agent
    _steps: Steps | None = field(default=None, init=False)  # of that session, if it is step by step
    _reported: tuple[CheckResult, CheckReport] | None = field(default=None, init=False)  # the latest one
    _waiting: int = field(default=0, init=False)  # calls of agents that wait for a mission or a skill
    _under_way: set[str] = field(default_factory=set, init=False)  # what threads do for agents

    def propose(self, order: MissionOrder, steps: Steps | None = None) -> MissionSession:
        """Begin a mission that waits for approval. Raise MissionError while a person works on another one.

        `steps` holds the skill calls of a step-by-step mission; None for a mission with a program.
        """
        before = self.console.session
        view = SessionView() if before is None else before.view
        is_own = before is None or (before is self._session and not before.is_changed_by_person)
        if not (is_own or view.is_over):
            raise MissionError("a person is working on another mission; wait until that mission is over")
        if len(order.program) > MAX_PROGRAM_LENGTH:  # it would have no contract
            raise UserError(f"the program has more than {MAX_PROGRAM_LENGTH:,} characters; shorten it")
        if not order.has_program and not self.writes:
            raise UserError("no model is configured that can write programs; send a program")
        session = self.console.begin(order, by_agent=True)
        self._session, self._steps = session, steps
        return session

    def propose_steps(
        self, purpose: str, bounds: Mapping[str, Any], author: str
    ) -> tuple[MissionSession, Steps]:
        """Propose a step-by-step mission for the agent `author`. `bounds` is its contract as plain data."""
        if self.console.view.is_running:  # before the bounds are read, which takes time
            raise MissionError("a mission is running; wait until it is over, or stop it")
        if len(json.dumps(bounds)) > MAX_CONTRACT_CHARACTERS:
            raise UserError(TOO_LONG)
        known = self.console.robot.skills.without(self.console.robot.missing)
        steps = Steps(purpose, contract_from(bounds, known), known)
        if len(steps.program) > MAX_CONTRACT_CHARACTERS:
            raise UserError(TOO_LONG)
        order = MissionOrder(
            purpose, program=steps.program, author=author, drive=steps.drive, contract=steps.contract
        )
        return self.propose(order, steps), steps

    def find_session(self, digest: str) -> MissionSession:
        """Return the current session if its program has this digest, or else raise MissionError."""
        session = self.console.session
        if session is None or session.view.is_over:
            view = SessionView() if session is None else session.view
            why = f"; mission {view.id} is {view.phase}" if view.id else view.error and f"; {view.error}"
            raise MissionError(f"no mission is waiting or running{why}; propose a new one")
        if session.view.digest != digest:
            raise MissionError("the current mission has another digest; call follow_mission for that digest")
        return session

    def find_steps(self, key: str) -> tuple[MissionSession, Steps]:
        """Return the running step-by-step mission with this key, or else raise MissionError."""
        steps, session = self._steps, self._session
        if steps is None or session is None or not compare_digest(steps.key.encode(), key.encode()):
            raise MissionError("no step-by-step mission has this key; call begin_steps to propose one")
        if not self.takes_steps(session):
            raise MissionError(NOT_RUNNING)
        return session, steps

    def takes_steps(self, session: MissionSession) -> bool:
        """Whether an agent can call skills in a session now. False if a person has replaced its program."""
        steps, view = self._steps, session.view
        is_running = view.state is MissionState.RUNNING and session is self._session
        return is_running and steps is not None and view.program == steps.program

    def approves_alone(self, session: MissionSession) -> bool:
        """Whether the contract given at the start allows a mission, so that no person has to approve it.

        False after a STOP, if the check found problems, or if a person has changed the program or its rules.
        """
        view = session.view
        if self.console.is_held:
            return False
        is_agents = session is self._session and not session.is_changed_by_person
        is_within = view.within is not None and view.contract is not None
        return is_agents and is_within and view.may_be_approved and not view.problems

    def contract_text(self, contract: Contract | None) -> str:
        """Return a contract in sentences, or "" if there is no contract."""
        if contract is None:
            return ""
        whole = partial(brief_part, most=MAX_PROGRAM_LENGTH)
        return contract_sentence(contract, self.console.robot.skills, whole, is_short=False)

    def may_ask_client(self, view: SessionView) -> bool:
        """Whether clients may ask for approval in a dialog: if the program can run and is short enough."""
        check = self._report_check(view)
        contract = "" if check is None else check.contract
        is_short = max(len(view.program), len(contract)) <= MAX_ASKED_CHARACTERS
        is_short = is_short and len(view.problems) <= MAX_ASKED_PROBLEMS
        return self.asks_client and view.can_run and is_short

    def check(self, program: str) -> CheckReport:
        """Check a program in the rooms that are known now, without starting a mission."""
        checked = self.console.check(program, self.console.view.room_map, self.console.rules)
        problems = [problem.sentence for problem in checked.problems]
        problems += missing_skills(program, self.console.robot)
        return report_check(checked, program, problems, self.contract_text(checked.contract))

    @contextmanager
    def waiting(self) -> Iterator[None]:
        """In a `with` block, count the current call as waiting. Raise MissionError if too many calls wait."""
        if self._waiting >= MAX_WAITING_CALLS:
            raise MissionError(f"{MAX_WAITING_CALLS} calls are waiting; try again when one has ended")
        self._waiting += 1
        try:
            yield
        finally:
            self._waiting -= 1

    def write(self, author: ModelAuthor, prompt: Prompt) -> CheckReport:
        """Have a model write a program, and check it. Raise UserError if the reply has no program."""
        _, (made, *_) = author.write(prompt, 1, ignore_text)
        if made.programless is not None:
            raise UserError(made.programless.sentence)
        return self.check(made.reply.program)

    async def run_exclusively(self, kind: str, work: Callable[[], _Made]) -> _Made:
        """Run slow work on a new thread, so that people never wait for it, and return its result.

        Raise MissionError if work of the same `kind`, such as `check`, is still running.
        """
        if kind in self._under_way:
            raise MissionError(f"another {kind} is still running; try again when it has finished")
        self._under_way.add(kind)
        made = Future[_Made]()
        made.set_running_or_notify_cancel()
        made.add_done_callback(lambda _: self._under_way.discard(kind))  # before the result is awaited

        def run() -> None:
            try:
                made.set_result(work())
            except BaseException as error:  # noqa: BLE001 - raised again where the result is awaited
                made.set_exception(error)

        Thread(target=run, daemon=True).start()
        return await asyncio.wrap_future(made)

    def report(self, session: MissionSession | None, after: int = 0) -> MissionReport:
        """Describe a session's mission for agents. None means that there is no mission yet.

        The report skips the first `after` events, and contains up to 1,000 of the next events.
        """
        view = SessionView() if session is None else session.view
        events = [] if session is None else session.events()
        seen = min(len(events), after + MAX_REPORTED_EVENTS)
        past = view.past and replace(view.past, trace=view.past.trace[-MAX_REPORTED_EVENTS:])
        return MissionReport(
            mission=view.id,
            state=view.phase,
            reason=view.reason or view.error,
            digest=view.digest,
            check=self._report_check(view),
            remarks=[*view.unknown_rooms, *view.remarks, *filter(None, [self.console.warning])],
            events=[text for text in map(event_text, events[after:seen]) if text],
            event_count=seen,
            done_before=[] if past is None else past.steps,
            is_over=view.is_over,
            next=self._next(view),
        )

    def _report_check(self, view: SessionView) -> CheckReport | None:
        """Describe the check of a mission. Its storyboards are drawn once, since agents may ask often."""
        if view.check is None:
            return None
        if self._reported is None or self._reported[0] is not view.check:
            contract = self.contract_text(view.contract)
            self._reported = view.check, report_check(view.check, view.program, view.problems, contract)
        return self._reported[1]

    def report_robot(self) -> RobotReport:
        """Describe the robot for agents: its skills, its house rules, and the rooms that are known now."""
        console, room_map = self.console, self.console.view.room_map
        on_map = [] if console.world is None else [room.name for room in console.world.rooms]
        skills = console.robot.skills.without(console.robot.missing)
        return RobotReport(
            robot=console.robot.name,
            rooms=on_map if room_map is None else room_map.described,
            skills=[skill.signature for skill in skills.values()],
            house_rules=[f"{rule.name}: {rule.says}" for rule in console.rules],
            how_to_write=prompt_for("instruction", skills=skills).messages[0].text,
            can_write_program=self.writes,
        )

    def _next(self, view: SessionView) -> str:
        if view.is_over:
            return "This mission is over; propose another." if view.number else "Propose a mission."
        if view.is_running:
            return "Follow the mission with follow_mission, or call its skills; stop stops the robot."
        if view.waits_for_answer:
            return "The person must choose between behaviours: call choose_behaviour, or they use the page."
        if not view.may_be_approved:
            return view.error or "The program is not ready: call follow_mission, or propose another one."
        if not view.can_run:
            return "This program has a syntax error. Correct the program, and propose it again."
        why = "After a STOP or the loss of the robot, a" if self.console.is_held else "A"
        where = f"on the open page, or by the link to {self.page} that was printed at the start"
        if self.may_ask_client(view):
            where = f"in the dialog that run_mission opens, if this client has dialogs, or {where}"
        return f"{why} person must approve this program {where}. Then call run_mission with its digest."
