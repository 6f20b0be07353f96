"""`LiveRobot`: executes and logs a program's skills on a robot, and starts no skill after a stop."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from itertools import chain
from typing import TypeAlias

from codebotler.checking.source.room_names import ROOM_SKILL
from codebotler.core.errors import RobotError
from codebotler.core.skills import kinds
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.trace import Event, Option, Trace, attempted_event, held_after, trace_data
from codebotler.core.world import Point
from codebotler.missions.display.progress import POSITION_FEEDBACK
from codebotler.missions.stop import StopButton
from codebotler.robots import base
from codebotler.robots.base import CameraPicture, CancelledError, RobotLostError
from codebotler.simulator.guard.contract import has_place, is_goal
from codebotler.simulator.guard.house_rule import RuleViolationError
from codebotler.simulator.guard.rule_guard import RuleGuard, name_of
from codebotler.simulator.settings import LIVE_LIMITS, SimulationSettings
from codebotler.simulator.worlds.robot import Argument, Result
from codebotler.simulator.worlds.room_map import NO_ROOMS, RoomMap
from codebotler.simulator.worlds.simulated_world import unknown_room

MIN_LOGGED_SECONDS = 0.1
"""Shorter pauses are not logged, since a program may make thousands of them per second."""

EventWriter: TypeAlias = Callable[..., None]
"""A function that logs an event from any thread. It takes the kind and, as keyword arguments, the data."""


class StoppedError(Exception):
    """Raised to end a program whose mission was stopped."""


class LiveRobot:
    """Executes the skills that a program calls on a connected robot, real or simulated.

    `Worker.run_live` runs the program. `place` is the robot's current room, or "" if unknown. The program's
    clock starts at `clock_starts` (local time by default). Breaking a rule of `guard` presses `button`.
    """

    is_live = True

    def __init__(
        self,
        robot: base.Robot,
        write_event: EventWriter,
        *,
        place: str = "",
        clock_starts: datetime | None = None,
        guard: RuleGuard | None = None,
        room_map: RoomMap | None = None,
        button: StopButton | None = None,
    ) -> None:
        self.robot, self.skills, self._write_event = robot, robot.skills, write_event
        self._guard, self._room_map = guard, room_map
        self._button = button or StopButton(robot)
        self.broken_rule: dict[str, object] = {}  # the log entry of the rule that stopped the mission
        starts = clock_starts or datetime.now().astimezone().replace(tzinfo=UTC)
        self.settings = SimulationSettings(literals="as-written", limits=LIVE_LIMITS, clock_starts=starts)
        self.line: int | None = None  # the line of the program that calls the current skill
        self._place = place
        self._held = "" if room_map is None else held_after(room_map.past)
        self._room = place or None  # the current room, as rules name it; None if unknown
        self._has_asked = False
        self._at: Point | None = None  # the last reported position
        self._guard_lock = threading.RLock()  # poses arrive on one of the robot's threads
        self._events: list[Event] = []
        self._number = 0
        self._began: float | None = None
        self._stopped = self._button.ended
        self._fault: OSError | RobotLostError | None = None
        self._is_watched = False

    @property
    def now(self) -> float:
        """Seconds on the robot's clock since the program's first skill."""
        return 0.0 if self._began is None else self.robot.clock.now - self._began

    @property
    def trace(self) -> Trace:
        """The events of the mission so far, in order."""
        return tuple(self._events)

    def stop(self) -> None:
        """Cancel the robot's work and prevent further skills. Any thread may call this, even repeatedly."""
        self._button.cancel_robot()

    def sleep_until(self, now: float) -> None:
        """Wait until the clock `self.now` reaches `now`, in seconds. Raise StoppedError after a stop."""
        self.check_end()
        seconds = max(0.0, now - self.now)
        at = {} if self.line is None else {"line": self.line}
        if seconds >= MIN_LOGGED_SECONDS:
            self._write_event("sleep", seconds=round(seconds, 3), **at)
        self.robot.clock.wait(seconds)
        self.check_end()

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute a skill and return its result. Raise RobotError if the skill fails or a rule refuses it.

        To end the program, raise StoppedError, RobotLostError, or OSError if logging fails.
        """
        self.check_end()
        try:
            return self._execute(self.skills[skill], arguments)
        finally:
            if skill not in SKILLS:  # a custom skill may have moved the robot
                self._room, self._has_asked = None, False

    def _execute(self, row: Skill, arguments: Sequence[Argument]) -> Result:
        is_drive, words = row.is_drive, list[str]()
        if is_drive:  # rules must judge exactly the text that the robot receives
            given = [*zip(row.parameters, arguments, strict=True)]
            words = [str(one) for to, one in given if is_goal(row, to.name)]
            arguments = [self._listed(one) if is_goal(row, to.name) else one for to, one in given]
        event = attempted_event(row, arguments, place=self._place, time=self.now, holding=self._held)
        self._judge_call(row, arguments)
        room = "" if event is None else self._judge(event, words, is_drive=is_drive)
        if event and row.recording and row.recording.when_tried:
            self._events.append(event)
        try:
            result = self._perform_logged(row, [_plain_argument(argument) for argument in arguments], event)
        except RobotError:
            if event and row.recording and row.recording.judged_when_tried:
                self._report(event, room, is_drive=is_drive, failed=True)
            raise
        if event is None or row.recording is None:
            return result
        if row.recording.when_tried:
            self._events.pop()
        chosen = _chosen_option(result, event) if event.options else None
        answer = None if chosen is None else event.options[chosen].text
        found = result if isinstance(result, bool) else None
        self._events.append(replace(event, answer=answer, found=found))
        if is_drive:
            self._place = event.text
        elif event.kind == kinds.PICK:
            self._held = event.text or "something"
        elif event.kind == kinds.PLACE:
            self._held = ""
        self._report(self._events[-1], room, is_drive=is_drive)
        return result if chosen is None else chosen

    def _listed(self, goal: Argument) -> Argument:
        """Return the listed room that a goal means on a robot with its own planner, or a goal as it is.

        Raise RobotError if it names several listed rooms, or has one in a longer word, such as "kitchenette".
        """
        if not isinstance(goal, str):
            return goal
        known = self._room_map if self._room_map and self._room_map.plain else NO_ROOMS
        room, possible = known.room(goal), known.possible_rooms(goal)
        if room is None and possible:
            error = unknown_room(goal.strip(), possible)
            self._write_event("log", text=f"not sent to the robot: {error}")
            raise error
        return room or goal.strip()

    # --- rules

    def _judge_call(self, row: Skill, arguments: Sequence[Argument]) -> None:
        """Raise an error if the contract does not allow a call."""
        guard = self._guard
        if guard is None or not guard.contracts:
            return
        if self._room is None and has_place(row):
            self._room = self._ask_room()
        given = zip(row.parameters, arguments, strict=True)
        goals = (self._rooms_meant(str(one)) for parameter, one in given if is_goal(row, parameter.name))
        with self._enforcing():
            guard.judge_call(row, arguments, [*chain.from_iterable(goals)], self._room or "")

    def _judge(self, event: Event, words: Sequence[str], *, is_drive: bool) -> str:
        """Return the robot's room, or raise an error if a rule forbids an event, or a drive with `words`."""
        guard = self._guard
        if guard is None:
            return event.place
        is_lost = self._room is None
        rules = [rule for rule in guard.rules if is_lost and rule.depends_on_room(event)]
        may_leave = is_lost and is_drive and any(rule.when == "leaving" for rule in guard.rules)
        if rules or may_leave:
            self._room = self._ask_room()
        if rules and self._room is None:
            with self._enforcing():
                guard.give_up(rules, event)
        room = self._room or ""
        texts = dict.fromkeys([event.text, *words, *(self._rooms_meant(event.text) if is_drive else ())])
        with self._enforcing():
            guard.judge(*(replace(event, text=text, place=room) for text in texts), is_drive=is_drive)
        return room

    def _report(self, event: Event, room: str, *, is_drive: bool, failed: bool = False) -> None:
        """Report an executed event to the guard, because its result may break a rule."""
        guard = self._guard
        if guard is None:
            return
        seen = replace(event, place=room)
        if is_drive:
            goals = self._rooms_meant(event.text)
            seen = replace(seen, text=goals[0] if len(goals) == 1 else event.text)
            is_known = not failed and (len(goals) == 1 or self._room_map is None)
            self._room, self._has_asked = (seen.text if is_known else None), False
        with self._enforcing():
            guard.judge_result(seen)

    def _on_pose(self, at: Point | None) -> None:
        """Report a move to the guard as a straight line. A position of None means that poses are missing."""
        if self._guard is None or self._stopped.is_set():
            return
        if at is None:
            why = "the robot stopped reporting its position during a drive, but a rule needs the position"
            self._fault = RobotLostError(why)
            self.stop()
            return
        before, self._at = self._at or at, at
        with suppress(StoppedError, RuleViolationError), self._enforcing():  # keep errors off robot threads
            self._guard.record_drive(before, at, self._held)

    @contextmanager
    def _enforcing(self) -> Iterator[None]:
        """Hold the guard's lock, and handle a broken rule."""
        try:
            with self._guard_lock:
                yield
        except RuleViolationError as broken:
            self._enforce(broken)
            raise

    def _enforce(self, broken: RuleViolationError) -> None:
        """Stop the mission, or log the prevented call if the program may continue."""
        at = {} if self.line is None else {"line": self.line}
        entry = at | _rule_entry(broken)
        if broken.ends_run:
            self.broken_rule = entry  # the mission logs the rule, because this may be a robot's thread
            self._button.press(f"rule {broken.rule.name}")
        else:
            self._write_event("rule", **entry)
        self.check_end()

    def report_unkept(self) -> str:
        """If ending now would break a rule, log this and return a sentence about it; otherwise return ""."""
        broken = None if self._guard is None else self._guard.find_first_unkept()
        if broken is None:
            return ""
        self._write_event("rule", **_rule_entry(broken))
        return str(broken)

    def _rooms_meant(self, request: str) -> list[str]:
        """Return the rooms that a request may refer to, as rules name them."""
        rooms = [] if self._room_map is None else self._room_map.possible_rooms(request)
        return [*dict.fromkeys(name_of(self._full_name(room), request) for room in rooms)]

    def _full_name(self, room: str) -> str:
        return room if self._room_map is None else self._room_map.full_name(room)

    def _ask_room(self) -> str | None:
        """Ask the robot for its current room, but only once. Return None if the robot does not know."""
        if self._has_asked or ROOM_SKILL not in self.skills or ROOM_SKILL in self.robot.missing:
            return None
        self._has_asked = True
        try:
            here = str(check_answer(self.skills[ROOM_SKILL], self.robot.perform(ROOM_SKILL, ()))).strip()
        except (RobotError, CancelledError):
            return None
        listed = (here,) if self._room_map is None else self._room_map.goals
        room = next((room for room in listed if room.strip().casefold() == here.casefold()), "")
        room = self._full_name(room)
        words = name_of(room, self._place)
        return (words if words in self._rooms_meant(self._place) else room) or None

    def _perform_logged(
        self, skill: Skill, given: list[base.RobotArgument], event: Event | None
    ) -> base.RobotResult:
        self._number += 1
        which = {"number": self._number, "skill": skill.name}
        named = dict(zip((p.name for p in skill.parameters), given, strict=True))
        at = {} if self.line is None else {"line": self.line}
        self._write_event("skill", **which, **at, arguments=named)
        started = self.now
        try:
            result = self._call_robot(skill, given, event)
            if event is not None and event.options:
                _chosen_option(result, event)
        except RobotError as error:
            self._write_event("error", **which, kind=error.kind, message=str(error))
            self.check_end()
            raise
        except CancelledError:
            self._write_event("cancelled", **which, seconds=round(self.now - started, 3))
            self.check_end()
            raise RobotLostError("another client stopped the robot") from None
        self._write_event("late" if self._stopped.is_set() else "result", **which, result=result)
        self.check_end()
        return result

    def _call_robot(
        self, skill: Skill, given: list[base.RobotArgument], event: Event | None
    ) -> base.RobotResult:
        which = {"number": self._number, "skill": skill.name}

        def on_feedback(feedback: str | CameraPicture) -> None:
            try:
                if isinstance(feedback, CameraPicture):
                    self._write_event("picture", **which, picture=feedback.data)
                else:
                    if not self._is_watched and (match := POSITION_FEEDBACK.fullmatch(feedback)):
                        self._on_pose((float(match[1]), float(match[2])))
                    self._write_event("feedback", **which, text=feedback)
            except OSError as error:  # an error that is raised on a robot's thread would be lost
                self._fault = error
                self.stop()

        if event is not None and skill.recording and skill.recording.options and not event.options:
            raise RobotError("AskEmptyOptions", f'the question "{event.text}" offers no options')
        return check_answer(skill, self.robot.perform(skill.name, given, on_feedback))

    def check_end(self) -> None:
        """Raise StoppedError or another error if the program must end. The first call sets `now` to 0."""
        if self._began is None:
            self._began = self.robot.clock.now
            watch = getattr(self.robot, "watch", None)  # an optional method
            if watch is not None and self._guard is not None and self._guard.judges_poses:
                self._is_watched = watch(self._on_pose)
        if self._fault is not None:
            raise self._fault
        if self._stopped.is_set():
            raise StoppedError


def check_answer(skill: Skill, result: base.RobotResult) -> base.RobotResult:
    """Check a robot's result for a skill. Return it, or raise RobotLostError if its type is wrong."""
    if not skill.returns.fits(result):
        answer = f"{skill.name} with {result!r:.100}, which is not of the type {skill.returns.annotation}"
        raise RobotLostError(f"the robot answered {answer}; correct the robot's driver")
    return result


def _rule_entry(broken: RuleViolationError) -> dict[str, object]:
    """Return the log entry for a rule that was broken or that prevented a call."""
    rule, event = broken.rule, broken.event
    what = {} if event is None else {"what": trace_data((event,))[0], "prevented": not broken.is_late}
    why = {"why": broken.why} if broken.why else {}
    return {"rule": rule.name, "says": rule.says, "formula": str(rule.formula), **what, **why}


def _plain_argument(argument: Argument) -> base.RobotArgument:
    if not isinstance(argument, tuple):
        return argument
    return tuple(each.text if isinstance(each, Option) else each for each in argument)


def _chosen_option(result: base.RobotResult, event: Event) -> int:
    """Return the position of the chosen option, ignoring case, or raise RobotError if no option matches."""
    heard = str(result)
    for same in (str, lambda text: text.strip().casefold()):
        for number, option in enumerate(event.options):
            if same(option.text) == same(heard):
                return number
    offered = ", ".join(option.text for option in event.options)
    why = f'the answer "{heard}" to "{event.text}" is not one of the options ({offered})'
    raise RobotError("AskInvalidOptions", why)
