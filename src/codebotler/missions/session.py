"""`MissionSession`: takes a mission through writing, checking, approval and execution, for any interface."""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from codebotler.candidates.clusters import compare_candidates
from codebotler.candidates.question import ClarifyingAnswer, ClarifyingQuestion, question_about
from codebotler.checking.sampled import CheckSettings, UnwantedCheckError
from codebotler.core.errors import UserError
from codebotler.core.terminal import visible
from codebotler.core.world import World
from codebotler.missions.authoring import ModelAuthor, prompt_of
from codebotler.missions.display.shared_view import SharedView
from codebotler.missions.display.view import CHECKING, UNCHECKED, MissionOrder, SessionView, program_digest
from codebotler.missions.drafts import examine_draft
from codebotler.missions.mission import Mission, MissionError
from codebotler.missions.preflight import (
    EXPECTED_ERRORS,
    ask_rooms,
    error_sentence,
    expect_enforceable,
    limit_rooms,
    resume_robot,
    with_closest_here,
)
from codebotler.missions.stop import StopButton
from codebotler.missions.storage.log import MissionState
from codebotler.missions.storage.past import expect_continuable
from codebotler.missions.storage.store import find_mission
from codebotler.models.base import Model, ModelError
from codebotler.models.recorded import UnknownInstructionError
from codebotler.robots.base import CancelledError, NotReadyError, Robot
from codebotler.robots.reservation import Reservation
from codebotler.simulator.guard.contract import Contract
from codebotler.simulator.guard.house_rule import Rule
from codebotler.simulator.worlds.room_map import RoomMap

_logger = logging.getLogger("codebotler.missions")


class MissionSession(SharedView):
    """Runs one mission on its own thread, with a robot that stays connected during the whole session.

    `home` contains the folder `missions`. `changed` is called after each change of the view and must not
    block. The session first waits for the session `before` to end. `world` is the map of the rooms. `within`
    limits what any program may do, in addition to the rules, unless it is None.
    """

    def __init__(
        self,
        robot: Robot,
        home: Path,
        order: MissionOrder,
        *,
        open_model: Callable[[str], Model],
        rules: tuple[Rule, ...] = (),
        changed: Callable[[], None] = lambda: None,
        number: int = 1,
        before: MissionSession | None = None,
        world: World | None = None,
        within: Contract | None = None,
    ) -> None:
        super().__init__(order.first_view(number, rules, within), changed)
        self._robot, self._home, self._order = robot, home, order
        self._before, self._world = before, world
        self._author = ModelAuthor(open_model, order.model)
        self._stop_button = StopButton()
        self._checked: Contract | None = None  # of the last checked program
        self._editing = threading.Lock()  # held while the program is replaced or approved
        self._rejected: ClarifyingQuestion | None = None  # whose options a person did not mean
        take, ask = partial(self._take, program=order.program), partial(self._ask, repair=False)
        self._next_task: Callable[[Mission], None] | None = take if order.has_program else ask
        self._stop_button.on_press(self._end_waiting)
        self._thread = threading.Thread(target=self._run, name=f"session-{number}", daemon=True)
        self.error: Exception | None = None  # set if an error ended the session
        self.is_approved_by_person = False
        self.is_changed_by_person = False  # whether a person edited, asked again or switched off a rule

    def start(self) -> None:
        """Start the session's thread."""
        self._thread.start()

    def join(self, seconds: float | None = None) -> None:
        """Wait until the session has ended, or at most `seconds` if given."""
        self._thread.join(seconds)

    def edit(self, program: str) -> None:
        """Replace the program and check it in the background. Raise MissionError if edits are not allowed."""
        with self._editing, self._lock:
            if self._view.is_over or not self._view.may_be_edited:
                raise MissionError("the program cannot be changed while a model is writing or after approval")
            self._next_task = partial(self._take, program=program)
            self.is_changed_by_person = True
            self._change(program=program, author="", question=None, disabled_rules=(), **UNCHECKED)

    def switch_off(self, name: str, reason: str) -> None:
        """Switch off the rule `name` for this program only, log the reason, and check again.

        Raise MissionError if no program waits for approval, the rule is not in force, or the reason is empty.
        """
        if not any(letter.isalnum() for letter in reason):
            raise MissionError("give a reason why this program may break the rule")
        with self._editing:
            view, mission = self._view, self._mission
            if mission is None or not view.may_be_approved:
                raise MissionError("rules can be switched off only while a program waits for approval")
            if name not in {rule.name for rule in view.rules_in_force}:
                raise MissionError(f'the rule "{name}" is unknown or already switched off')
            mission.note(f'a person switched off the rule "{name}" for this program: {reason.strip()}')
            with self._lock:
                self._next_task = partial(self._take, program=view.program)
                self.is_changed_by_person = True
                self._change(disabled_rules=(*view.disabled_rules, name), **UNCHECKED)

    def ask_again(self, *, repair: bool, max_tokens: int | None = None) -> None:
        """Ask the model for another program. With `repair`, also send the last one and its problems.

        `max_tokens` is a new limit for this reply and later ones; None keeps the limit. Raise MissionError if
        the model cannot be asked now.
        """
        with self._editing, self._lock:
            if not self._view.may_be_asked_again:
                raise MissionError("the model can be asked again only while a mission waits for a person")
            self._author.max_tokens = max_tokens or self._author.max_tokens
            self._next_task = partial(self._ask, repair=repair)
            self.is_changed_by_person = True
            self._change(busy=f"asking {self._view.model}", is_written=True, reply="")

    def answer(self, question: ClarifyingQuestion | None, answer: ClarifyingAnswer, more: str = "") -> None:
        """Continue with a person's answer to `question`, the clarifying question that they saw.

        `answer` is an option's index (from 0), `decide` for the first one, or `none`. With `none`, the text
        `more` is added to the instruction, and the model is asked again. Without a text, or after the
        last question, `none` ends the mission.

        Raises:
            MissionError: the question is closed, there is no such option, or `more` was given without `none`.
        """
        with self._editing, self._lock:
            view = self._view
            if question is None or question is not view.question or not view.waits_for_answer:
                raise MissionError("this question is no longer open; look at the mission again")
            if isinstance(answer, int) and not 0 <= answer < len(question.options):
                raise MissionError(f"there is no option {answer + 1}; choose 1 to {len(question.options)}")
            if answer != "none" and more.strip():
                raise MissionError('text can be added only to "none of these"; choose that, or omit the text')
            more = " ".join(more.split())
            self.is_changed_by_person |= bool(more)
            self._next_task = partial(self._take_answer, question=question, answer=answer, more=more)
            self._change(question=None, busy=CHECKING)

    def approve(
        self,
        seen: str,
        *,
        despite_problems: bool = False,
        disabled_rules: tuple[str, ...] | None = None,
        by: str = "",
        is_person: bool = True,
    ) -> None:
        """Approve the program whose digest is `seen`. Raise MissionError if it cannot be approved now.

        `disabled_rules` are the rules that the person saw switched off, or None to skip this comparison. `by`
        names the approver in the log. `is_person` is False if an earlier approval covers the program, which
        a person must not have changed since.
        """
        with self._editing:
            view, mission = self._view, self._mission
            if self._is_stopped:
                raise MissionError("the mission is being stopped; its program cannot be approved")
            if mission is None or view.busy or view.question is not None:
                raise MissionError("no program is ready yet; wait for the check, or answer the open question")
            if seen != view.digest or seen != program_digest(mission.summary.program):
                raise MissionError("the program has changed; review the new program")
            if disabled_rules is not None and disabled_rules != view.disabled_rules:
                raise MissionError("the list of switched-off rules has changed; review the program again")
            if not view.can_run:
                raise MissionError("this program has a syntax error; correct the program")
            if self.is_changed_by_person and not is_person:
                raise MissionError("a person has changed this program; a person must approve it")
            mission.approve(despite_problems=despite_problems, by=by)
            self.is_approved_by_person = is_person

    @property
    def is_approved(self) -> bool:
        """Whether the program is approved, or runs. On a slow disk, the view shows it later."""
        return self._mission is not None and self._mission.is_approved

    def reject(self, reason: str) -> None:
        """End the mission as failed, before it runs, and log the reason."""
        assert self._mission is not None, "there is a program to reject"
        self._mission.fail(reason)

    def stop(self, by: str) -> None:
        """Stop the robot, then other work. Return once the robot has the request. The log names `by`."""
        has_ended = self._view.is_over or (self._mission is not None and self._mission.has_ended)
        if self.may_move or not has_ended:
            self._stop_button.press(by)

    def stop_soon(self, by: str) -> threading.Thread:
        """Call `stop` on a new thread, since signal handlers must not wait, and return the thread."""
        stopping = threading.Thread(target=self.stop, args=(by,), daemon=True)
        stopping.start()
        return stopping

    def _end_waiting(self) -> None:
        """Wake the session's own thread after a press of the stop button."""
        self._author.cancel()
        with self._lock:
            self._lock.notify_all()

    def _run(self) -> None:
        try:
            if self._before is not None:
                self._before.join()
                self._before = None
            self._show(busy="connecting the robot")
            if not self._is_stopped:
                self._lead_mission()
        except UnknownInstructionError as error:
            self.error = with_closest_here(error, self._view.room_map)
            self._show(error=error_sentence(error), suggestions=self.error.closest)
        except Exception as error:
            if not isinstance(error, EXPECTED_ERRORS):
                _logger.exception("a mission failed unexpectedly")
            if isinstance(error, NotReadyError) and self._is_stopped:
                return  # expected, because a stopped robot answers no questions
            self.error = error
            self._show(error=error_sentence(error))
        finally:
            self._show(is_over=True, busy="", is_written=False)

    def _lead_mission(self) -> None:
        attach = partial(self._stop_button.attach, self._robot)
        with Reservation(self._robot, self._home, attach) as reserved:
            attach()  # again, since a press may have come before the robot was connected
            name, instruction = self._robot.name, self._order.instruction
            if (past := self._order.past) is not None:
                # Another mission may have done the rest since this past was read.
                expect_continuable(find_mission(self._home, past.mission))
            with Mission(self._home, name, instruction, self._add_event, self._stop_button) as mission:
                self._mission = mission
                if past is not None:
                    mission.continue_from(past)
                self._show(id=mission.id)
                if self._world is not None:
                    mission.log_map(self._world)
                if past is not None:
                    resume_robot(self._robot, past)
                room_map, place = self._prepare_rooms()
                self._await_approval(mission)
                if mission.state is MissionState.APPROVED:
                    self._run_approved(mission, reserved, place, room_map)

    def _prepare_rooms(self) -> tuple[RoomMap | None, str]:
        """Ask the robot for its rooms and its current room. Refuse rules that cannot be enforced."""
        room_map, place = ask_rooms(self._robot, self._add_remark, self._world)
        if (past := self._order.past) is not None:
            room_map, place = past.add_to(room_map, place)
            self._show(progress=replace(past.progress, room=place))
        self._show(room_map=limit_rooms(room_map, self._add_remark))
        expect_enforceable(self._view.rules, self._robot, room_map, self._add_remark)
        return room_map, place

    def _await_approval(self, mission: Mission) -> None:
        """Write and check programs until a person approves one or ends the mission."""
        while mission.state.is_open:
            with self._lock:
                self._lock.wait_for(lambda: self._next_task is not None or not mission.state.is_open)
                task, self._next_task = self._next_task, None
            if task is not None:
                task(mission)

    def _run_approved(
        self, mission: Mission, reserved: Reservation, place: str, room_map: RoomMap | None
    ) -> None:
        for sentence in (*self._view.missing_skills, *self._view.unknown_rooms):
            mission.note(f"before the robot moves: {sentence}")
        rules = self._view.rules_in_force
        keep_out = getattr(self._robot, "keep_out", None)  # an optional method of robots with a path planner
        with suppress(MissionError, CancelledError):  # the mission was stopped before it could run
            if keep_out is not None:
                keep_out(rules)
            view = self._view
            drive = self._order.drive if mission.summary.program == self._order.program else None
            contracts = [one for one in (view.contract, view.within) if one is not None]
            mission.run(reserved, place, rules=rules, room_map=room_map, contracts=contracts, drive=drive)
        if mission.stuck is not None:  # no other process may use the robot meanwhile
            self._show(is_over=True)
            mission.stuck.join()

    @property
    def _is_stopped(self) -> bool:
        return self._stop_button.by is not None

    def _is_wanted(self) -> bool:
        """Whether the current check is still wanted: the mission is open and no newer program waits."""
        return self._next_task is None and self._mission is not None and not self._mission.has_ended

    def _ask(self, mission: Mission, *, repair: bool) -> None:
        """Ask the model for a program and check it. Keep the previous program if the reply has none."""
        before, count = self._view, 1 if repair else self._order.candidates
        many = f" for {count} programs" if count > 1 else ""
        writing = {"busy": f"asking {before.model}{many}", "is_written": True}
        self._show(**UNCHECKED | writing, program="", reply="", error="")
        try:
            prompt = prompt_of(replace(before, disabled_rules=()), self._robot, repair=repair)
            if self._rejected is not None and not repair:
                prompt = prompt.after(self._rejected.options[0].program, self._rejected.rejections)
            author, attempts = self._author.write(prompt, count, self._add_to_reply)
        except asyncio.CancelledError:
            self._restore(before)
            return
        except UnknownInstructionError as error:
            mission.fail(error_sentence(error))
            raise
        except (UserError, ModelError) as error:
            if not before.program and before.programless is None:
                raise
            self._restore(before)
            self._show(error=visible(str(error)))
            return
        programs = [one.reply.program for one in attempts if one.programless is None]
        if not programs and (none := attempts[-1].programless) is not None:
            mission.note(none.sentence)
            self._restore(replace(before, programless=none))
            return
        self._show(is_written=False, author=author, disabled_rules=())
        if count > 1:
            self._choose(mission, programs)
        else:
            self._take(mission, programs[-1])

    def _choose(self, mission: Mission, programs: Sequence[str]) -> None:
        """Take one of several programs, or ask the person which one is meant if they differ."""
        self._show(busy="comparing the programs")
        skills, rules = self._robot.skills, self._view.rules_in_force
        how = CheckSettings(skills=skills, house_rules=rules, is_wanted=self._is_wanted)
        try:
            groups = compare_candidates(programs, how, self._view.room_map)
        except (UserError, UnwantedCheckError):
            if self._is_wanted():
                raise
            return
        question = question_about(groups, model=self._view.model, is_second=self._rejected is not None)
        if question is not None and self._order.asks:
            with self._lock:
                if self._next_task is None:  # else a person has written a program meanwhile
                    self._change(question=question, busy="")
        else:
            self._add_remark(groups.summary)
            self._take(mission, groups.clusters[0].program)

    def _take_answer(
        self, mission: Mission, *, question: ClarifyingQuestion, answer: ClarifyingAnswer, more: str
    ) -> None:
        for sentence in question.record(answer):
            mission.note(sentence)
        option = question.chosen(answer)
        if option is not None:
            self._take(mission, option.program)
        elif not more or question.why_last:
            mission.fail(f"no program does what was meant{question.why_last and '; '}{question.why_last}")
        else:
            self._rejected = question
            mission.extend_instruction(more)
            self._show(instruction=mission.summary.instruction)
            self._ask(mission, repair=False)

    def _restore(self, before: SessionView) -> None:
        kept = {name: getattr(before, name) for name in (*UNCHECKED, "program", "author")}
        self._show(**kept | {"busy": ""}, is_written=False, reply="")

    def _take(self, mission: Mission, program: str) -> None:
        """Check a program for the mission, unless a newer program is waiting."""
        with self._lock:
            if self._next_task is not None:
                return
            self._change(program=program, error="", reply="", **UNCHECKED)
            view = self._view
        try:
            mission.set_program(program, view.author)
            found = examine_draft(program, view, self._order, self._robot, self._is_wanted)
            mission.record_check(replace(view, **found).problems)
        except (MissionError, UnwantedCheckError):
            if self._is_wanted():
                raise
            return
        with self._lock:
            if self._next_task is None:
                self._change(**found, earlier=self._checked)
                self._checked = found["check"].contract
