"""`MissionSession`: takes one mission from writing through checking and approval to its end.

The command line and the page drive a session, and observe it; it prints nothing and knows no page.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from codebotler.checking.evasions import evasions
from codebotler.checking.problems import Check
from codebotler.checking.rule_rooms import expect_rooms
from codebotler.core.errors import UserError
from codebotler.core.terminal import system_sentence, visible
from codebotler.core.world import World
from codebotler.generation.generate import Generation, write_program
from codebotler.missions.log import Line, State
from codebotler.missions.mission import Mission, MissionError
from codebotler.missions.preflight import (
    expect_poses,
    missing_skills,
    preflight,
    rooms_to_check,
    unknown_rooms,
    with_closest_here,
)
from codebotler.missions.view import CHECKING, Order, SessionView, digest
from codebotler.models.base import Model, ModelError
from codebotler.models.open import open_model
from codebotler.models.recorded import UnknownInstructionError
from codebotler.prompts import prompt_for
from codebotler.robots.base import CancelledError, NotReadyError, Robot
from codebotler.robots.reservation import Reservation
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.sampled_robot import RoomMap
from codebotler.simulator.worker import EngineError

LOG = logging.getLogger("codebotler.missions")
EXPECTED = (UserError, ModelError, NotReadyError, EngineError, MissionError, OSError)


@dataclass(frozen=True)
class Again:
    """A person's wish for another program.

    Args:
        repair: whether the model is shown what was wrong before.
        max_tokens: the limit for this reply and later ones; None for the last one.
    """

    repair: bool = False
    max_tokens: int | None = None


class MissionSession:
    """Drives one mission on a thread of its own, with a robot that is connected while the session lasts.

    `check` gets a program, the robot's rooms and the rules in force; `changed` is called at each change of
    the view and must return at once; `before` is the session to wait for; `world` is the map, if any.
    """

    def __init__(
        self,
        robot: Robot,
        home: Path,
        order: Order,
        *,
        open_model: Callable[[str], Model],
        check: Callable[[str, RoomMap | None, tuple[Rule, ...]], Check],
        rules: tuple[Rule, ...] = (),
        changed: Callable[[], None] = lambda: None,
        number: int = 1,
        before: MissionSession | None = None,
        world: World | None = None,
    ) -> None:
        self._robot, self._home, self._order = robot, home, order
        self._open_model, self._check, self._changed, self._before = open_model, check, changed, before
        self._world = world
        self._lock = threading.Condition()  # held for moments; never while a mission is asked for something
        self._editing = threading.Lock()  # held while a program is replaced or approved
        self._view = SessionView(
            number,
            instruction=order.instruction,
            model=order.model,
            program=order.program,
            author=order.author,
            busy="waiting",
            rules=rules,
            is_over=False,
        )
        self._events: list[Line] = []
        self._mission: Mission | None = None
        self._edited: str | None = None
        self._again: Again | None = None
        self._max_tokens: int | None = None  # that a person has chosen
        self._asked: Model | None = None  # the last one
        self._stopped_by: str | None = None
        self._asking: tuple[asyncio.AbstractEventLoop, asyncio.Task[Generation]] | None = None
        self._thread = threading.Thread(target=self._run, name=f"session-{number}", daemon=True)
        self.on_event: Callable[[Line], None] = lambda _: None  # what it raises stops the robot
        self.error: Exception | None = None  # that ended it, once it is over

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def join(self, seconds: float | None = None) -> None:
        """Wait for its end."""
        self._thread.join(seconds)

    def wait_until(self, holds: Callable[[SessionView], bool]) -> SessionView:
        """Wait for a view of which something holds, or for the last one; signals are handled meanwhile."""
        with self._lock:
            self._lock.wait_for(lambda: self._view.is_over or holds(self._view))
            return self._view

    @property
    def view(self) -> SessionView:
        """The current view."""
        return self._view

    def events(self, start: int = 0) -> list[Line]:
        """The events of the mission, from one on."""
        return self._events[start:]

    def edit(self, program: str) -> None:
        """Replace the program, and have it checked; MissionError if it is too late, or a model is writing."""
        with self._editing, self._lock:
            if self._view.is_over or not self._view.may_be_edited:
                raise MissionError("the program cannot be changed now")
            self._edited = program
            self._change(program=program, author="", busy=CHECKING, off=(), programless=None, **UNCHECKED)

    def switch_off(self, name: str, reason: str) -> None:
        """Leave out a rule for this program in this mission only, and check it again.

        Args:
            name: of the rule.
            reason: why, which is logged.
        """
        if not any(letter.isalnum() for letter in reason):
            raise MissionError("say why the rule does not count for this program")
        with self._editing, self._lock:
            view, mission = self._view, self._mission
            if mission is None or not view.may_be_approved:
                raise MissionError("rules can be switched off only while a program waits for approval")
            if name not in {rule.name for rule in view.rules_in_force}:
                raise MissionError(f'there is no rule "{name}" in force')
            mission.note(f'a person switched off the rule "{name}" for this program: {reason.strip()}')
            self._edited = view.program
            self._change(off=(*view.off, name), busy=CHECKING, **UNCHECKED)

    def ask_again(self, *, repair: bool, max_tokens: int | None = None) -> None:
        """Have the model write another program.

        Args:
            repair: whether it is shown this program with its problems, or why its reply holds none.
            max_tokens: another limit for this reply and later ones, in tokens; None for the last one.
        """
        with self._editing, self._lock:
            if not self._view.may_be_asked_again:
                raise MissionError("the model cannot be asked again now")
            self._again = Again(repair, max_tokens)
            self._change(busy=f"asking {self._view.model}", is_written=True, reply="", off=())

    def approve(self, seen: str, *, despite_problems: bool = False) -> None:
        """Let the robot run the program that the person saw, which is named by its digest."""
        with self._editing:
            view, mission = self._view, self._mission
            if mission is None or view.busy:
                raise MissionError("the program has not been checked yet")
            if seen != view.digest or seen != digest(mission.summary.program):
                raise MissionError("the program has changed; look at it again")
            mission.approve(despite_problems=despite_problems)

    def reject(self, reason: str) -> None:
        """End the mission before it runs."""
        assert self._mission is not None, "there is a program to reject"
        self._mission.fail(reason)

    def stop(self, by: str) -> None:
        """Stop whatever goes on; returns when the robot has been told."""
        self._stopped_by = self._stopped_by or by
        mission, asking = self._mission, self._asking
        try:
            if mission is not None and mission.state.is_open:
                self._robot.cancel()  # it may be asked which rooms there are
            if mission is not None:
                with suppress(MissionError):  # it ended by itself
                    mission.stop(by)
        finally:
            if asking is not None:
                with suppress(RuntimeError):  # the answer has arrived
                    asking[0].call_soon_threadsafe(asking[1].cancel)
            with self._lock:
                self._lock.notify_all()

    # --- on its own thread

    def _run(self) -> None:
        try:
            if self._before is not None:
                self._before.join()
                self._before = None
            self._show(busy="connecting the robot")
            self._through()
        except UnknownInstructionError as error:
            self.error = with_closest_here(error, self._view.room_map)
            self._show(trouble=_unknown(error), known=self.error.closest)
        except EXPECTED as error:
            self.error = error
            self._show(trouble=_sentence(error))
        except Exception as error:
            self.error = error
            LOG.exception("a mission failed unexpectedly")
            self._show(trouble=f"{type(error).__name__}: {visible(str(error))}")
        finally:
            self._show(**self._ending(), is_over=True, busy="", is_written=False)

    def _ending(self) -> dict[str, object]:
        """How the mission ended, also where that could not be logged."""
        if self._mission is None:
            return {}
        ended = self._mission.summary
        return {"state": ended.state, "reason": ended.reason, "line": ended.line}

    def _through(self) -> None:
        order = self._order
        if self._is_stopped():
            return
        with (
            Reservation(self._robot, self._home) as reserved,
            Mission(self._home, self._robot.name, order.instruction, told=self._note) as mission,
        ):
            self._mission = mission
            self._show(id=mission.id, state=mission.state)
            if self._world is not None:
                mission.show_map(self._world)
            if self._is_stopped():
                mission.stop(self._stopped_by or "")
                return
            try:
                room_map, place = preflight(self._robot, self._remark, self._world)
            except NotReadyError:
                if self._is_stopped():
                    return
                raise
            self._show(room_map=rooms_to_check(room_map, self._remark))
            rules, rooms = self._view.rules, () if room_map is None else room_map.rooms
            regexes = () if room_map is None or room_map.plain else rooms
            expect_rooms(rules, rooms)
            expect_poses(rules, self._robot, room_map)
            for sentence in evasions(rules, regexes, self._robot.skills):
                self._remark(sentence)
            if order.has_program:
                self._take(mission, order.program)
            else:
                self._ask(mission, Again())
            while mission.state.is_open:
                self._wait_for_a_person(mission)
            if mission.state is State.APPROVED:
                self._run_approved(mission, reserved, place, room_map)

    def _run_approved(
        self, mission: Mission, reserved: Reservation, place: str, room_map: RoomMap | None
    ) -> None:
        """Run the approved program."""
        self._note_warnings(mission)
        rules = self._view.rules_in_force
        keep_out = getattr(self._robot, "keep_out", None)  # which robots with a planner have
        with suppress(MissionError, CancelledError):  # it was stopped before it could run
            if keep_out is not None:
                keep_out(rules)
            mission.run(reserved, place, rules=rules, room_map=room_map)

    def _note_warnings(self, mission: Mission) -> None:
        """Log what speaks against the approved program; drafts before it had warnings of their own."""
        for sentence in (*self._view.missing_skills, *self._view.unknown_rooms):
            mission.note(f"before the robot moves: {sentence}")

    def _is_stopped(self) -> bool:
        return self._stopped_by is not None

    def _wait_for_a_person(self, mission: Mission) -> None:
        with self._lock:
            self._lock.wait_for(lambda: self._edited is not None or self._again or not mission.state.is_open)
            edited, again = self._edited, self._again
            self._again = None
        if not mission.state.is_open:
            return
        if again:
            self._ask(mission, again)
        elif edited is not None:
            self._take(mission, edited)

    def _ask(self, mission: Mission, how: Again) -> None:
        """Have the model write a program, and take it; without one, go on as before."""
        before = self._view
        self._show(
            **UNCHECKED,
            busy=f"asking {before.model}",
            is_written=True,
            program="",
            reply="",
            programless=None,
            trouble="",
        )
        try:
            model = self._opened(how)
            made = asyncio.run(self._written(model, before, how))
        except asyncio.CancelledError:
            self._restore(before)
            return
        except UnknownInstructionError as error:
            mission.fail(_unknown(error))
            raise
        except (UserError, ModelError) as error:
            if not before.program and before.programless is None:
                raise
            self._restore(before)
            self._show(trouble=visible(str(error)))
            return
        if (none := made.programless) is not None:
            mission.note(none.sentence)
            self._restore(replace(before, programless=none))
            return
        self._show(is_written=False, author=model.name)
        self._take(mission, made.program)

    def _opened(self, how: Again) -> Model:
        """The model, with the limit that a person has chosen."""
        self._max_tokens = how.max_tokens or self._max_tokens
        if self._max_tokens is None or self._asked is None:
            self._asked = self._open_model(self._order.model)
        if self._max_tokens is not None:
            settings = replace(self._asked.settings, max_tokens=self._max_tokens)
            self._asked = open_model(self._asked.name, settings)
        return self._asked

    def _restore(self, before: SessionView) -> None:
        """Show what was there before: no other program was written."""
        kept = ("program", "author", "check", "missing_skills", "unknown_rooms", "programless")
        self._show(**{name: getattr(before, name) for name in kept}, busy="", is_written=False, reply="")

    async def _written(self, model: Model, before: SessionView, how: Again) -> Generation:
        rooms = () if before.room_map is None else before.room_map.rooms
        rules = [rule.says for rule in self._view.rules_in_force]
        skills = self._robot.skills.without(self._robot.missing)
        prompt = prompt_for(self._order.instruction, rooms=rooms, rules=rules, skills=skills)
        if how.repair and before.problems:
            prompt = prompt.after(before.program, before.problems)
        elif how.repair and before.programless is not None:
            prompt = prompt.after_no_program(before.programless.sentence)
        task = asyncio.create_task(write_program(model, prompt, heard=self._heard))
        self._asking = (asyncio.get_running_loop(), task)
        try:
            if self._is_stopped():
                task.cancel()
            return await task
        finally:
            self._asking = None

    def _heard(self, piece: str) -> None:
        with self._lock:
            self._change(reply=self._view.reply + piece)

    def _take(self, mission: Mission, program: str) -> None:
        """Make a program the mission's, and check it."""
        with self._editing, self._lock:
            if self._edited not in {None, program}:
                return  # another one was typed meanwhile
            self._edited = None
            self._change(program=program, busy=CHECKING, trouble="", reply="", programless=None, **UNCHECKED)
            view = self._view
        try:
            mission.draft(program, view.author)
            check = self._check(program, view.room_map, view.rules_in_force)
            missing = tuple(missing_skills(program, self._robot))
            known = None if check.problems else view.room_map
            unknown = unknown_rooms(program, known, self._robot.skills) if known else ()
            checked = replace(
                view, check=check, missing_skills=missing, unknown_rooms=tuple(unknown), busy=""
            )
            mission.check(checked.problems)
        except MissionError:
            if not mission.has_ended:
                raise
            return
        with self._lock:
            if self._edited is None:
                names = (*UNCHECKED, "busy")
                self._change(**{name: getattr(checked, name) for name in names})

    # --- what observers see

    def _remark(self, sentence: str) -> None:
        assert self._mission is not None, "it has begun when the robot is asked"
        self._mission.note(sentence)
        self._show(remarks=(*self._view.remarks, sentence))

    def _note(self, line: Line) -> None:
        """Take an event of the mission, which holds its lock meanwhile."""
        with self._lock:
            self._events.append(line)
            view = self._view
            changes: dict[str, object] = {"progress": view.progress.after(line, view.program)}
            if line["event"] == "state":
                changes |= {"state": State(line["state"]), "reason": line.get("reason", "")}
                changes["line"] = line.get("line")
                if State(line["state"]).is_final:
                    changes["busy"] = ""
            self._change(**changes)
        self.on_event(line)

    def _show(self, **changes: object) -> None:
        with self._lock:
            self._change(**changes)

    def _change(self, **changes: object) -> None:
        """Change the view; the caller has the lock."""
        self._view = replace(self._view, **changes)  # type: ignore[arg-type]  # names and values of its fields
        self._lock.notify_all()
        self._changed()


UNCHECKED: dict[str, object] = {"check": None, "missing_skills": (), "unknown_rooms": ()}


def _unknown(error: UnknownInstructionError) -> str:
    return f"{error.model} has no program for this instruction"


def _sentence(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return system_sentence(error)
    return visible(str(error))
