"""`MissionSession`: takes one mission from writing through checking and approval to its end.

The command line and the page drive a session, and observe it; it prints nothing and knows no page.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from codebotler.checking.evasions import find_evasions
from codebotler.checking.problems import CheckResult
from codebotler.checking.rule_rooms import expect_rooms
from codebotler.core.errors import UserError
from codebotler.core.terminal import system_sentence, visible
from codebotler.core.world import World
from codebotler.missions.authoring import ModelAuthor, prompt_of
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
from codebotler.missions.stop import StopButton
from codebotler.missions.view import CHECKING, Order, SessionView, digest
from codebotler.models.base import Model, ModelError
from codebotler.models.recorded import UnknownInstructionError
from codebotler.robots.base import CancelledError, NotReadyError, Robot
from codebotler.robots.reservation import Reservation
from codebotler.simulator.house_rule import Rule
from codebotler.simulator.sampled_robot import RoomMap
from codebotler.simulator.worker import EngineError

LOG = logging.getLogger("codebotler.missions")
EXPECTED = (UserError, ModelError, NotReadyError, EngineError, MissionError, OSError)


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
        check: Callable[[str, RoomMap | None, tuple[Rule, ...]], CheckResult],
        rules: tuple[Rule, ...] = (),
        changed: Callable[[], None] = lambda: None,
        number: int = 1,
        before: MissionSession | None = None,
        world: World | None = None,
    ) -> None:
        self._robot, self._home, self._order = robot, home, order
        self._check, self._changed, self._before, self._world = check, changed, before, world
        self._author = ModelAuthor(open_model, order.model)
        self._stop_button = StopButton()
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
        self._wish: Callable[[Mission], None] | None = (  # of a person, for the session's own thread
            partial(self._take, program=order.program)
            if order.has_program
            else partial(self._ask, repair=False)
        )
        self._stop_button.on_press(self._end_waiting)
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
            self._wish = partial(self._take, program=program)
            self._change(program=program, author="", disabled_rules=(), **UNCHECKED)

    def switch_off(self, name: str, reason: str) -> None:
        """Leave out a rule for this program in this mission only, and check it again.

        Args:
            name: of the rule.
            reason: why, which is logged.
        """
        if not any(letter.isalnum() for letter in reason):
            raise MissionError("say why the rule does not count for this program")
        with self._editing:
            view, mission = self._view, self._mission
            if mission is None or not view.may_be_approved:
                raise MissionError("rules can be switched off only while a program waits for approval")
            if name not in {rule.name for rule in view.rules_in_force}:
                raise MissionError(f'there is no rule "{name}" in force')
            mission.note(f'a person switched off the rule "{name}" for this program: {reason.strip()}')
            with self._lock:
                self._wish = partial(self._take, program=view.program)
                self._change(disabled_rules=(*view.disabled_rules, name), **UNCHECKED)

    def ask_again(self, *, repair: bool, max_tokens: int | None = None) -> None:
        """Have the model write another program.

        Args:
            repair: whether it is shown this program with its problems, or why its reply holds none.
            max_tokens: another limit for this reply and later ones, in tokens; None for the last one.
        """
        with self._editing, self._lock:
            if not self._view.may_be_asked_again:
                raise MissionError("the model cannot be asked again now")
            self._author.max_tokens = max_tokens or self._author.max_tokens
            self._wish = partial(self._ask, repair=repair)
            self._change(busy=f"asking {self._view.model}", is_written=True, reply="", disabled_rules=())

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
        """Stop the robot, and then whatever else goes on; returns when the robot has the request."""
        if not self._view.is_over:
            self._stop_button.press(by)

    def stop_soon(self, by: str) -> None:
        """Stop it from where nothing may wait, such as a signal handler or the loop of a server."""
        threading.Thread(target=self.stop, args=(by,), daemon=True).start()

    def _end_waiting(self) -> None:
        """Let the session's own thread see that the stop button was pressed."""
        self._author.cancel()
        with self._lock:
            self._lock.notify_all()

    # --- on its own thread

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
            self._show(error=_sentence(error), suggestions=self.error.closest)
        except Exception as error:
            if not isinstance(error, EXPECTED):
                LOG.exception("a mission failed unexpectedly")
            if isinstance(error, NotReadyError) and self._is_stopped:
                return  # the robot gives no answers any more
            self.error = error
            self._show(error=_sentence(error))
        finally:
            self._show(is_over=True, busy="", is_written=False)

    def _lead_mission(self) -> None:
        with Reservation(self._robot, self._home) as reserved:
            self._stop_button.attach(self._robot)
            name, instruction = self._robot.name, self._order.instruction
            with Mission(self._home, name, instruction, self._note, self._stop_button) as mission:
                self._mission = mission
                self._show(id=mission.id)
                if self._world is not None:
                    mission.show_map(self._world)
                room_map, place = self._look_around()
                self._get_approved(mission)
                if mission.state is State.APPROVED:
                    self._run_approved(mission, reserved, place, room_map)

    def _look_around(self) -> tuple[RoomMap | None, str]:
        """Ask the robot for its rooms and where it is, and refuse rules that it cannot keep to."""
        room_map, place = preflight(self._robot, self._remark, self._world)
        self._show(room_map=rooms_to_check(room_map, self._remark))
        rules, rooms = self._view.rules, () if room_map is None else room_map.rooms
        regexes = () if room_map is None or room_map.plain else rooms
        expect_rooms(rules, rooms)
        expect_poses(rules, self._robot, room_map)
        for sentence in find_evasions(rules, regexes, self._robot.skills):
            self._remark(sentence)
        return room_map, place

    def _get_approved(self, mission: Mission) -> None:
        """Have programs written and checked until a person approves one or ends the mission."""
        while mission.state.is_open:
            with self._lock:
                self._lock.wait_for(lambda: self._wish is not None or not mission.state.is_open)
                wish, self._wish = self._wish, None
            if wish is not None:
                wish(mission)

    def _run_approved(
        self, mission: Mission, reserved: Reservation, place: str, room_map: RoomMap | None
    ) -> None:
        """Run the approved program."""
        for sentence in (*self._view.missing_skills, *self._view.unknown_rooms):
            mission.note(f"before the robot moves: {sentence}")
        rules = self._view.rules_in_force
        keep_out = getattr(self._robot, "keep_out", None)  # which robots with a planner have
        with suppress(MissionError, CancelledError):  # it was stopped before it could run
            if keep_out is not None:
                keep_out(rules)
            mission.run(reserved, place, rules=rules, room_map=room_map)

    @property
    def _is_stopped(self) -> bool:
        return self._stop_button.by is not None

    def _ask(self, mission: Mission, *, repair: bool) -> None:
        """Have the model write a program, and take it; without one, go on as before."""
        before = self._view
        writing = {"busy": f"asking {before.model}", "is_written": True}
        self._show(**UNCHECKED | writing, program="", reply="", error="")
        try:
            prompt = prompt_of(before, self._robot, repair=repair)
            author, made = self._author.write(prompt, self._add_to_reply)
        except asyncio.CancelledError:
            self._restore(before)
            return
        except UnknownInstructionError as error:
            mission.fail(_sentence(error))
            raise
        except (UserError, ModelError) as error:
            if not before.program and before.programless is None:
                raise
            self._restore(before)
            self._show(error=visible(str(error)))
            return
        if (none := made.programless) is not None:
            mission.note(none.sentence)
            self._restore(replace(before, programless=none))
            return
        self._show(is_written=False, author=author)
        self._take(mission, made.program)

    def _restore(self, before: SessionView) -> None:
        """Show what was there before: no other program was written."""
        kept = {name: getattr(before, name) for name in (*UNCHECKED, "program", "author")}
        self._show(**kept | {"busy": ""}, is_written=False, reply="")

    def _add_to_reply(self, piece: str) -> None:
        with self._lock:
            self._change(reply=self._view.reply + piece)

    def _take(self, mission: Mission, program: str) -> None:
        """Make a program the mission's, and check it, unless another one was typed meanwhile."""
        with self._lock:
            if self._wish is not None:
                return
            self._change(program=program, error="", reply="", **UNCHECKED)
            view = self._view
        try:
            mission.draft(program, view.author)
            check = self._check(program, view.room_map, view.rules_in_force)
            missing = tuple(missing_skills(program, self._robot))
            known = None if check.problems else view.room_map
            unknown = tuple(unknown_rooms(program, known, self._robot.skills)) if known else ()
            found = {"check": check, "missing_skills": missing, "unknown_rooms": unknown, "busy": ""}
            mission.check(replace(view, **found).problems)  # type: ignore[arg-type]  # values of its fields
        except MissionError:
            if not mission.has_ended:
                raise
            return
        with self._lock:
            if self._wish is None:
                self._change(**found)

    # --- what observers see

    def _remark(self, sentence: str) -> None:
        assert self._mission is not None, "it has begun when the robot is asked"
        self._mission.note(sentence)
        self._show(remarks=(*self._view.remarks, sentence))

    def _note(self, line: Line) -> None:
        """Take an event of the mission, which holds its lock meanwhile."""
        with self._lock:
            self._events.append(line)
            self._change(progress=self._view.progress.after(line))
        self.on_event(line)

    def _show(self, **changes: object) -> None:
        with self._lock:
            self._change(**changes)

    def _change(self, **changes: object) -> None:
        """Change the view, and have it follow the mission's state; the caller has the lock."""
        if self._mission is not None:
            now = self._mission.summary
            changes |= {"state": now.state, "reason": now.reason, "line": now.line}
            if now.has_ended:
                changes["busy"] = ""
        self._view = replace(self._view, **changes)  # type: ignore[arg-type]  # names and values of its fields
        self._lock.notify_all()
        self._changed()


UNCHECKED: dict[str, object] = {
    "check": None,
    "missing_skills": (),
    "unknown_rooms": (),
    "programless": None,
    "busy": CHECKING,
}
"""What a view shows of a program before its check."""


def _sentence(error: Exception) -> str:
    if isinstance(error, UnknownInstructionError):
        return f"{error.model} has no program for this instruction"
    if isinstance(error, OSError) and error.filename is not None:
        return system_sentence(error)
    sentence = visible(str(error))
    return sentence if isinstance(error, EXPECTED) else f"{type(error).__name__}: {sentence}"
