"""The operator's console: the robot and the current mission, shared by all viewers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from socket import gethostname
from typing import Self

from codebotler.checking.check import check
from codebotler.checking.problems import CheckResult
from codebotler.core.errors import UserError
from codebotler.core.files import make_folder
from codebotler.core.program import called_skills, parse_leniently
from codebotler.core.terminal import shortened
from codebotler.core.world import World
from codebotler.missions.display.view import MissionOrder, SessionView
from codebotler.missions.display.wording import BY_PAGE, capitalize
from codebotler.missions.mission import BY_SHUTDOWN, STOP_GRACE_SECONDS, MissionError
from codebotler.missions.recovery import PriorApproval, ask_evidence, past_to_recover
from codebotler.missions.session import MissionSession
from codebotler.missions.stop import StopButton
from codebotler.missions.storage.log import MissionState, MissionSummary
from codebotler.missions.storage.past import MissionPast, read_past
from codebotler.missions.storage.store import find_interrupted, find_mission
from codebotler.models.base import Model
from codebotler.robots.base import Robot
from codebotler.robots.face import Face
from codebotler.robots.reservation import Reservation, normalize_address
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.pool import SHARED_POOL
from codebotler.simulator.worlds.room_map import RoomMap
from codebotler.web.hold_file import HoldFile
from codebotler.web.notifier import Notifier

MAX_PROGRAM_CHARACTERS = 200_000  # the maximum length of a program or an instruction
MAX_WAIT_SECONDS = 15.0  # the longest time that a request waits for a change
CLEANUP_SECONDS = 2.0  # the time limit for ending a mission if its program has not begun to run


class Console:
    """Begins, changes and stops the missions of one robot, for the page, for agents and for the terminal.

    Any thread may use it. Only missions connect the robot. The first of `models` is the default. `within`
    limits what any program may do. A model writes `candidates` programs for each instruction. If a skill
    fails, a model may write a program for the rest of the mission, up to `recoveries` times in a row.
    """

    def __init__(
        self,
        robot: Robot,
        home: Path,
        open_model: Callable[[str], Model],
        *,
        models: Sequence[str] = ("recorded:careful", "recorded:hasty"),
        world: World | None = None,
        face: Face | None = None,
        rules: tuple[Rule, ...] = (),
        within: Contract | None = None,
        candidates: int = 1,
        recoveries: int = 0,
    ) -> None:
        self.robot, self.home, self.models, self.world = robot, home, tuple(models), world
        self.candidates = candidates
        self.notifier, self.face, self.rules, self.within = Notifier(), face, rules, within
        if face is not None:
            face.changed = self.notifier.change
        self.interrupted: tuple[MissionSummary, ...] = ()
        self.open_model, self.recoveries = open_model, recoveries
        self._lock = threading.RLock()  # held briefly, and again by a signal handler
        self.session: MissionSession | None = None  # the current session, or else the last one
        self._may_recover: MissionSession | None = None  # the current session, unless somebody pressed STOP
        self.unfinished = ""  # the mission that had begun and ended early before another one was written
        self._checking = threading.Lock()
        # A hold reaches as far as the lock of the robot: this machine, or without an address this folder.
        where = f"{normalize_address(robot.address)} {gethostname()}" if robot.address else ""
        digest = sha256(where.encode(errors="surrogatepass")).hexdigest()
        press = partial(self.stop, "STOP in another process")
        self._hold = HoldFile(home / "robots" / f"{robot.name} {digest}.held", press)
        self._stopped: MissionSession | None = None  # the session at the last hold in this process
        self._lost: MissionSession | None = None  # whose robot may still move
        self._stopping = threading.Thread()  # sends a stop to that robot
        self._asking: StopButton | None = None  # of a robot that is asked where it is
        self.presses = 0  # of STOP since the start, also in another process
        self._began = 0.0  # the time at which the current session began
        self.used_elsewhere = ""  # a sentence about the process that used the robot at the last STOP

    def __enter__(self) -> Self:
        self.interrupted = tuple(find_interrupted(self.home))
        make_folder(self.home / "missions")
        self._hold.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Stop the current mission, and wait up to 11 s for its end, or 2 s if its program has not begun."""
        with self._lock:
            session, self._may_recover = self.session, None
            self._end_hold()
            lost = self._forget_loss()
        if (asking := self._asking) is not None:
            asking.press(BY_SHUTDOWN)
        if lost is not None:
            lost.stop_soon(BY_SHUTDOWN).join(STOP_GRACE_SECONDS)
        self._hold.close()
        is_checking = self._checking.locked() or (session is not None and bool(session.view.busy))
        if session is not None and session is not lost:
            session.stop(BY_SHUTDOWN)
        if is_checking:
            SHARED_POOL.end()  # else a check delays the end of this process
        if session is not None:
            session.join(STOP_GRACE_SECONDS + 1 if session.view.progress.has_begun else CLEANUP_SECONDS)

    @property
    def view(self) -> SessionView:
        """The view of the current mission, or else of the last one; empty before the first."""
        session = self.session
        return SessionView() if session is None else session.view

    async def view_once(self, *, over: bool) -> SessionView:
        """Wait up to 15 s until the mission is over or, if `over` is false, has begun. Return its view."""
        await self.notifier.until(lambda: self.view.is_over == over, MAX_WAIT_SECONDS)
        return self.view

    def begin(
        self, order: MissionOrder, *, by_agent: bool = False, after: MissionSession | None = None
    ) -> MissionSession:
        """Begin a mission, by default with the first model. Raise MissionError while another mission runs.

        With `by_agent`, keep the notice about interrupted missions, so that a person still sees it. With
        `after`, also raise MissionError if STOP was pressed or another mission began after that session.
        """
        noticed = self.interrupted if by_agent else ()
        session = self._begin(order, after=after)
        self.interrupted = noticed
        if self.recoveries:
            threading.Thread(target=self._recover, args=(session,), daemon=True).start()
        return session

    def _begin(self, order: MissionOrder, *, after: MissionSession | None = None) -> MissionSession:
        """Begin a mission, or only if nothing has happened since the end of the session `after`."""
        model = order.model.strip() or ("" if order.has_program else self.models[0])
        count = 1 if order.has_program or order.past is not None else self.candidates
        program = order.program if order.has_program else ""
        order = replace(
            order, instruction=order.instruction.strip(), model=model, program=program, candidates=count
        )
        for text in (order.instruction, order.program):
            _check_length(text)
        with self._lock:
            before = self.session
            if before is not None and before.view.is_running:
                raise MissionError(f"mission {before.view.id} is {before.view.state}; stop it first")
            if after is not None and after is not self._may_recover:
                raise MissionError("the mission did not begin because somebody pressed STOP or began another")
            if self._stopping.is_alive():
                raise MissionError("the robot has not answered a stop request yet; check the robot")
            if before is not None and before.is_stuck:
                raise MissionError(f"a skill of mission {before.view.id} has not ended; check the robot")
            self._end_hold()
            self._forget_loss()
            if order.past is not None:
                self.unfinished = ""
            elif before is not None and before.view.progress.has_begun:
                self.unfinished = "" if before.view.state is MissionState.DONE else before.view.id
            self.session = self._may_recover = session = MissionSession(
                self.robot,
                self.home,
                order,
                open_model=self.open_model,
                rules=self.rules,
                changed=self._change,
                number=before.view.number + 1 if before else 1,
                before=before,
                world=self.world,
                within=self.within,
            )
            self._began = time.time()
            session.start()
        if before is not None and not before.view.is_over:
            before.stop_soon("another instruction")
        self.interrupted = ()
        self.notifier.change()
        return session

    def past_of(self, mission: str) -> MissionPast:
        """Read what a mission (an ID or `last`) did and saw. Raise UserError if it cannot be continued."""
        robot, folder = self.robot, find_mission(self.home, mission)
        return read_past(folder, robot.skills, robot.name, self.world, robot.address)

    def rest_of(
        self, past: MissionPast, program: str = "", author: str = "", *, model: str = ""
    ) -> MissionOrder:
        """Return an order to do the rest of a mission. Without `program`, reuse its own or ask a model.

        `model` is the name of the model to ask, or "" for the one that wrote the mission's program.
        """
        # A step-by-step mission has no program of its own: the text only describes it.
        skills = called_skills(parse_leniently(past.program), self.robot.skills)
        if not program and ((past.is_untouched and skills) or not past.instruction):
            program, author = past.program, past.model
            model = past.model if past.model in self.models else ""
        else:
            known = past.model if past.model in self.models else self.models[0]
            model = "" if program else model or known
        return MissionOrder(past.instruction, model, program, author, past=past)

    def ask_evidence(self, past: MissionPast, remark: Callable[[str], None]) -> list[str]:
        """Return sentences that help a person to decide whether the step `past.unsure` happened."""
        with self._lock:
            if self._asking is not None:
                raise MissionError("the robot is already being asked what happened; wait for its answer")
            self._asking = button = StopButton()
        try:
            return ask_evidence(self.robot, self.home, past, remark, button)
        finally:
            self._asking = None

    def _recover(self, session: MissionSession) -> None:
        """Begin the rest of a mission while skills fail, and approve what the latest approval allows."""
        approval: PriorApproval | None = None
        with suppress(MissionError, UserError):  # a person must decide
            for _ in range(self.recoveries):
                past = past_to_recover(session, self.robot, self.home)
                if past is None:
                    return
                if approval is None or session.is_approved_by_person:
                    approval = PriorApproval.of(session.view)
                session = self._begin(self.rest_of(past), after=session)
                view = session.wait_until(lambda now: now.may_be_approved or now.waits_for_program)
                if approval is not None and approval.allows(view, past) and self._may_recover is session:
                    by = f"the approval of mission {approval.mission}"
                    with suppress(MissionError):  # a person has changed the rest, and approves it, too
                        session.approve(view.digest, by=by, is_person=False)
                    if self._may_recover is not session:
                        session.stop(BY_PAGE)

    def edit(self, program: str) -> MissionSession:
        """Replace the current program, or begin a new mission if the current one has ended."""
        _check_length(program)
        session = self.session
        if session is None or session.view.is_over:
            before = self.view
            past = None if before.progress.has_begun else before.past  # the rest still has to be done
            if program == before.program:
                order = MissionOrder(before.instruction, before.model, program, before.author, past=past)
                return self.begin(order)
            kept = before.instruction if past or is_version_of(before.program, program) else ""
            return self.begin(MissionOrder(kept, before.model if kept else "", program, past=past))
        session.edit(program)
        return session

    @property
    def is_held(self) -> bool:
        """Whether a person must approve the next mission, because STOP was pressed or the robot was lost."""
        return self._hold.exists

    def _end_hold(self) -> None:
        """End the hold after a person's STOP if a person has approved the mission that began after it."""
        session = self.session
        if session is not None and session.is_approved_by_person and session is not self._stopped:
            self._hold.remove(before=self._began)

    def dismiss(self) -> None:
        """Dismiss the notice about interrupted missions."""
        self.interrupted = ()
        self.notifier.change()

    def stop(self, by: str, *, only_moving: bool = False, holds: bool = False) -> bool:
        """Ask the current mission to stop, without waiting. Return whether there was a mission to stop.

        `by` names the source for the log. A robot that was lost, or did not confirm a stop, is stopped again.
        With `only_moving`, spare a mission without approval, unless a robot was lost. With `holds`, a
        person must approve the next mission, even if there was nothing to stop.
        """
        with self._lock:
            session, self._may_recover = self.session, None
            self.presses += 1
            lost = self._forget_loss()
            self._end_hold()
            asking = self._asking
            is_active = asking is not None or (session is not None and not session.view.is_over)
            other = "" if is_active or lost is not None else Reservation(self.robot, self.home).holder()
            self.used_elsewhere = other and f"another tool ({other}) uses the robot"
            is_approved = session is not None and session.is_approved
            may_move = lost is not None or bool(self._hold.warning or other)
            stops = not only_moving or may_move or is_approved or asking is not None
            if session is not None and is_active and stops:
                session.stop_soon(by)
            if asking is not None:
                threading.Thread(target=asking.press, args=(by,), daemon=True).start()
            if lost is not None and not self._stopping.is_alive():
                self._stopping = lost.stop_soon(by)
            if holds:
                self._stopped = session if stops else self._stopped
                self._hold.write()
        self.notifier.change()  # a click that was made before this press counts no more
        return stops and (is_active or lost is not None)

    def _forget_loss(self) -> MissionSession | None:
        """Forget a lost robot once a person has approved a later mission. Return who lost it, if anybody."""
        session = self.session
        if session is not None and session.is_approved_by_person and session is not self._lost:
            self._lost = None
        return self._lost

    @property
    def warning(self) -> str:
        """Why a lost robot may still move, as a sentence; empty after a person has approved a new mission."""
        if (lost := self._forget_loss()) is None:
            if self._hold.warning:
                self._end_hold()
            return self._hold.warning
        return f"The robot may still move. {capitalize(shortened(lost.view.reason))}."

    def _change(self) -> None:
        """Wake all viewers. Once a robot is lost, have a person approve the next mission."""
        session = self.session
        if session is not None and session.may_move and session is not self._lost:
            self._lost = self._stopped = session
            self._hold.write(self.warning)
        self.notifier.change()

    def check(
        self, program: str, room_map: RoomMap | None = None, rules: tuple[Rule, ...] = ()
    ) -> CheckResult:
        """Check a program outside any mission. Without `room_map`, use the rooms that the program names."""
        skills = self.robot.skills
        with self._checking:  # the check of a mission must not wait for those of many clients
            return check(program, room_map=room_map, house_rules=rules, skills=skills, explores=True)


def is_version_of(program: str, changed: str) -> bool:
    """Whether an edited program keeps at least half of its lines, so that its instruction still applies."""
    lines = [line for line in map(str.strip, program.splitlines()) if line]
    kept = set(map(str.strip, changed.splitlines()))
    return bool(lines) and 2 * sum(line in kept for line in lines) >= len(lines)


def _check_length(text: str) -> None:
    if len(text) > MAX_PROGRAM_CHARACTERS:
        raise UserError(f"the text has {len(text):,} characters; the limit is {MAX_PROGRAM_CHARACTERS:,}")
