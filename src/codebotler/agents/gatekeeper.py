"""`Gatekeeper`: takes proposals from agents, which a person or a contract must approve."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

from codebotler.agents.reports import (
    MAX_ASKED_CHARACTERS,
    ContractText,
    MissionReport,
    RobotReport,
    SkillReport,
    report_mission,
)
from codebotler.agents.steps import NOT_RUNNING, Steps
from codebotler.core.errors import UserError
from codebotler.core.words import listed
from codebotler.missions.log import MissionState
from codebotler.missions.mission import MissionError
from codebotler.missions.session import MissionSession
from codebotler.missions.view import MissionOrder, SessionView
from codebotler.prompts import prompt_for
from codebotler.web.console import Console

Approver: TypeAlias = Callable[[SessionView], bool]
"""Whether a contract, given at the start, approves the program of a view without asking a person."""

BY_CONTRACT = "the contract given at the start"


def approve_nothing(_view: SessionView) -> bool:
    """Leave all approvals to people."""
    return False


def know_no_contract(_view: SessionView) -> str:
    """Return an empty string."""
    return ""


@dataclass
class Gatekeeper:
    """Passes the wishes of agents to the console that the page also uses. No method approves for an agent.

    Args:
        console: the robot and its current mission.
        asks_client: whether a client may ask its person, in a dialog that its agent cannot answer.
        writes: whether a model is configured that can write programs.
        page: the address of the page, without its token; empty without a page.
        approves: the contract given at the start.
        contract_text: describes what a program can do at most.
    """

    console: Console
    asks_client: bool = False
    writes: bool = False
    page: str = ""
    approves: Approver = approve_nothing
    contract_text: ContractText = know_no_contract
    _proposed: MissionSession | None = field(default=None, init=False)  # the latest session of an agent
    _steps: Steps | None = field(default=None, init=False)  # of that session, if it is step by step

    def propose(self, order: MissionOrder, steps: Steps | None = None) -> MissionSession:
        """Begin a mission that waits for approval. Raise MissionError if the console is busy with another."""
        before = self.console.session
        if before is not None and not before.view.is_over and before is not self._proposed:
            raise MissionError("a person is working on a mission of their own; wait until it is over")
        if not order.has_program and not self.writes:
            raise UserError("no model is configured that can write programs; send a program")
        session = self.console.begin(order)
        self._proposed, self._steps = session, steps
        return session

    def propose_steps(self, purpose: str, skills: list[str], author: str) -> tuple[MissionSession, Steps]:
        """Propose a mission in which the agent calls skills one at a time. An empty list means all skills."""
        robot = self.console.robot
        known = robot.skills.without(robot.missing)
        if unknown := [name for name in skills if name not in known]:
            raise UserError(f"this robot has no skill {listed(unknown, 'or')}; it has {listed(list(known))}")
        allowed = known.without(known.keys() - set(skills)) if skills else known
        steps = Steps(purpose, allowed)
        order = MissionOrder(purpose, program=steps.program, author=author, drive=steps.drive)
        return self.propose(order, steps), steps

    def find_session(self, digest: str) -> MissionSession:
        """Return the current session if its program has this digest, or else raise MissionError."""
        session = self.console.session
        if session is None or session.view.is_over:
            ended = "" if session is None else f"; mission {session.view.id} is {session.view.phase}"
            raise MissionError(f"no mission is waiting or running{ended}; propose one")
        if not secrets.compare_digest(session.view.digest.encode(), digest.encode()):
            raise MissionError(
                "the current mission has another program; follow_mission shows it and its digest"
            )
        return session

    def find_steps(self, key: str) -> tuple[MissionSession, Steps]:
        """Return the running step-by-step mission with this key, or else raise MissionError."""
        steps, session = self._steps, self._proposed
        if steps is None or session is None or not secrets.compare_digest(steps.key.encode(), key.encode()):
            raise MissionError("there is no step-by-step mission with this key; begin_steps begins one")
        if session.view.state is not MissionState.RUNNING:
            raise MissionError(NOT_RUNNING)
        return session, steps

    def is_stepwise(self, session: MissionSession) -> bool:
        """Whether an agent calls the skills of a session one at a time."""
        return self._steps is not None and session is self._proposed

    def may_ask_client(self, view: SessionView) -> bool:
        """Whether a client may ask its person to approve a program, which must fit into a dialog."""
        return self.asks_client and view.can_run and len(view.program) <= MAX_ASKED_CHARACTERS

    def report(
        self, session: MissionSession | None, after: int = 0, steps: Steps | None = None
    ) -> MissionReport:
        """Return a session's mission, with its events after a position."""
        view = SessionView() if session is None else session.view
        events = [] if session is None else session.events()
        text = self.contract_text(view) if view.check is not None else ""
        report = report_mission(view, events, after, text, self._next(session, view))
        return report.model_copy(update={"steps": steps.key}) if steps else report

    def report_robot(self) -> RobotReport:
        """Return the robot with all that it knows now."""
        console, robot, view = self.console, self.console.robot, self.console.view
        rooms = [] if view.room_map is None else view.room_map.described
        if not rooms and console.world is not None:
            rooms = [room.name for room in console.world.rooms]
        rules = [f"{rule.name}: {rule.says}" for rule in console.rules]
        usable = robot.skills.without(robot.missing)
        guide = prompt_for("instruction", skills=usable).messages[0].text
        missing = robot.missing.get
        return RobotReport(
            robot=robot.name,
            rooms=rooms,
            skills=[
                SkillReport(signature=one.signature, does=one.doc, missing=missing(one.name, ""))
                for one in robot.skills.values()
            ],
            house_rules=rules,
            how_to_write=guide,
            can_write_program=self.writes,
            mission=view.phase,
        )

    def _next(self, session: MissionSession | None, view: SessionView) -> str:
        if session is None:
            return "There is no mission yet; propose one."
        if view.is_running:
            steps = "Call skills with call_skill, then end_steps; stop stops the robot."
            waits = "The robot is working: follow_mission waits for news, and stop stops the robot."
            return steps if self.is_stepwise(session) else waits
        if view.may_be_approved:
            where = f"A person must approve this program {self._where(view)}. Then call run_mission."
            return where if view.can_run else "This program cannot run. Mend it, and propose it again."
        if view.waits_for_program:
            return "The model sent no program; propose one, or word the instruction differently."
        return "This mission is over." if view.is_over else "The program is not ready: call follow_mission."

    def _where(self, view: SessionView) -> str:
        ways = []
        if self.may_ask_client(view):
            ways.append("in the dialog that run_mission opens, if this client has such dialogs")
        if self.page:
            ways.append(f"on the page {self.page}, whose link with its token CodeBotler printed at the start")
        return listed(ways, "or") if ways else "in a contract given at the start"


def approve_for_person(session: MissionSession, digest: str, by: str) -> None:
    """Approve exactly the program that a person or a contract has approved."""
    session.approve(digest, despite_problems=bool(session.view.problems), by=by)
