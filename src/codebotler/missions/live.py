"""Between a running program and its robot: logs each skill, and refuses new ones after a stop."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from datetime import UTC, datetime
from typing import Protocol

from codebotler.checking.room_names import ROOM_SKILL
from codebotler.core.errors import RobotError
from codebotler.core.skills import kinds
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.trace import Event, Option, Trace, attempted_event, trace_data
from codebotler.core.world import Point
from codebotler.missions.progress import AT
from codebotler.missions.stop import StopButton
from codebotler.robots import base
from codebotler.robots.base import CameraPicture, CancelledError, RobotLostError
from codebotler.simulator.house_rule import NO_GOAL, NO_ROOM, RuleViolationError
from codebotler.simulator.robot import Argument, Result
from codebotler.simulator.rule_guard import RuleGuard, name_of
from codebotler.simulator.sampled_robot import RoomMap
from codebotler.simulator.settings import ENDLESS, SimulationSettings


class Note(Protocol):
    """Logs an event, from any thread; the `picture` of one is bytes."""

    def __call__(self, event: str, /, **data: object) -> None:
        """Log an event."""


class StoppedError(Exception):
    """The robot was stopped, and with it the program."""


class LiveRobot:
    """Answers what `Worker.run_live` asks of a robot, by a connected real or simulated one.

    The program's clock starts at `clock_starts`, by default the time of day here, since programs speak of the
    time to people. `button` is pressed where a rule is broken.
    """

    is_live = True

    def __init__(
        self,
        robot: base.Robot,
        note: Note,
        *,
        place: str = "",
        clock_starts: datetime | None = None,
        guard: RuleGuard | None = None,
        room_map: RoomMap | None = None,
        button: StopButton | None = None,
    ) -> None:
        self.robot, self.skills, self._note = robot, robot.skills, note
        self._guard, self._room_map = guard, room_map
        self._button = button or StopButton(robot)
        self.broken_rule: dict[str, object] = {}  # the log entry of the rule that stopped the mission
        starts = clock_starts or datetime.now().astimezone().replace(tzinfo=UTC)
        self.rules = SimulationSettings(literals="as-written", limits=ENDLESS, clock_starts=starts)
        self.line: int | None = None  # of the program, which calls a skill there
        self._place, self._held = place, ""
        self._room = place or None  # where the robot is, as rules name it; None until it is asked
        self._has_asked = False
        self._at: Point | None = None  # where the robot said it is
        self._guarding = threading.RLock()  # poses come from a thread of the robot
        self._events: list[Event] = []
        self._number = 0
        self._began: float | None = None
        self._stopped = self._button.ended
        self._fault: OSError | RobotLostError | None = None
        self._is_watched = False

    @property
    def now(self) -> float:
        """Seconds by the robot's clock since the program began with its first skill."""
        return 0.0 if self._began is None else self.robot.clock.now - self._began

    @property
    def trace(self) -> Trace:
        """The robot's trace so far."""
        return tuple(self._events)

    def stop(self) -> None:
        """Cancel the robot's work and start nothing more; from any thread, any number of times."""
        self._button.cancel_robot()

    def sleep_until(self, now: float) -> None:
        """Let time pass by the robot's clock, or raise StoppedError."""
        self._check_end()
        seconds = max(0.0, now - self.now)
        at = {} if self.line is None else {"line": self.line}
        self._note("sleep", seconds=round(seconds, 3), **at)
        self.robot.clock.wait(seconds)
        self._check_end()

    def perform(self, skill: str, arguments: Sequence[Argument]) -> Result:
        """Execute one skill, or raise RobotError, StoppedError, RobotLostError, or OSError for its log."""
        self._check_end()
        try:
            return self._performed(self.skills[skill], arguments)
        finally:
            if skill not in SKILLS:  # nobody knows what a user's skill does inside
                self._room, self._has_asked = None, False

    def _performed(self, row: Skill, arguments: Sequence[Argument]) -> Result:
        """Execute one skill, and return its result."""
        is_drive = row.is_drive
        if is_drive:  # what is judged is what the robot is told
            arguments = [one.strip() if isinstance(one, str) else one for one in arguments]
        event = attempted_event(row, arguments, place=self._place, time=self.now, holding=self._held)
        room = "" if event is None else self._judge(event, is_drive=is_drive)
        if event and row.recording and row.recording.when_tried:
            self._events.append(event)
        try:
            result = self._logged(row, [_text(argument) for argument in arguments], event)
        except RobotError:
            if event and row.recording and row.recording.when_tried:
                self._happened(event, room, is_drive=is_drive, failed=True)
            raise
        if event is None or row.recording is None:
            return result
        if row.recording.when_tried:
            self._events.pop()
        chosen = _position(result, event) if event.options else None
        answer = None if chosen is None else event.options[chosen].text
        found = result if isinstance(result, bool) else None
        self._events.append(replace(event, answer=answer, found=found))
        if is_drive:
            self._place = event.text
        self._hold(event)
        self._happened(self._events[-1], room, is_drive=is_drive)
        return result if chosen is None else chosen

    def _hold(self, event: Event) -> None:
        match event.kind:
            case kinds.PICK:
                self._held = event.text or "something"
            case kinds.PLACE:
                self._held = ""

    # --- rules

    def _judge(self, event: Event, *, is_drive: bool) -> str:
        """Refuse an event that a rule forbids, before it reaches the robot; return the room where it is."""
        guard = self._guard
        if guard is None:
            return event.place
        rules = [rule for rule in guard.rules if self._room is None and event.kind in rule.kinds_in_rooms]
        if rules:
            self._room = self._ask_room()
        if rules and self._room is None:
            with self._enforcing():
                guard.give_up(rules, event, "cannot judge", NO_ROOM)
        room = self._room or ""
        texts = dict.fromkeys([event.text, *(self._goals(event.text) if is_drive else ())])
        with self._enforcing():
            guard.judge(*(replace(event, text=text, place=room) for text in texts))
        return room

    def _happened(self, event: Event, room: str, *, is_drive: bool, failed: bool = False) -> None:
        """Tell the guard what has happened in a room, which may break a rule that depends on an answer."""
        guard = self._guard
        if guard is None:
            return
        seen = replace(event, place=room)
        if is_drive:
            seen = self._driven(guard, seen, failed=failed)
        with self._enforcing():
            guard.happened(seen)

    def _driven(self, guard: RuleGuard, event: Event, *, failed: bool) -> Event:
        """Return a drive by the name of the room to which it led; if a rule depends on it, ask the robot."""
        goals = self._goals(event.text)
        possible = [replace(event, text=goal) for goal in goals or [event.text]]
        is_known = not failed and (len(goals) == 1 or self._room_map is None)
        self._room, self._has_asked = (possible[0].text if is_known else None), False
        rules = [rule for rule in guard.rules if rule.tells_apart(possible)]
        if not rules:
            return possible[0]
        if not failed:  # where it remains does not tell where it has tried to go
            self._room = self._ask_room()
        if self._room is not None:
            return replace(event, text=self._room)
        with self._enforcing():
            guard.give_up(rules, event, "could not judge", NO_GOAL)
        return possible[0]

    def _moved(self, at: Point | None) -> None:
        """Tell the guard which rooms the robot has entered, as if it drove straight between its reports.

        None says that it drives without telling where.
        """
        if self._guard is None or self._stopped.is_set():
            return
        if at is None:
            self._fault = RobotLostError("it drove on without telling where it is, which a rule needs")
            self.stop()
            return
        before, self._at = self._at or at, at
        with suppress(StoppedError, RuleViolationError), self._enforcing():  # maybe a thread of the robot
            self._guard.moved(before, at, self._held)

    @contextmanager
    def _enforcing(self) -> Iterator[None]:
        """Let one thread at a time ask the guard; end the mission by a rule that is broken."""
        try:
            with self._guarding:
                yield
        except RuleViolationError as broken:
            self._end_by(broken)
            raise

    def _end_by(self, broken: RuleViolationError) -> None:
        """Stop the mission, or log which call a rule has prevented where the program may go on."""
        at = {} if self.line is None else {"line": self.line}
        entry = at | _rule_entry(broken)
        if broken.ends_run:
            self.broken_rule = entry  # the mission logs it, since this may not be the program's thread
            self._button.press(f"rule {broken.rule.name}")
        else:
            self._note("rule", **entry)
        self._check_end()

    def report_unkept(self) -> str:
        """Log the first rule that is not kept at the end, and return the sentence; empty if all are."""
        broken = None if self._guard is None else self._guard.at_end()
        if broken is None:
            return ""
        self._note("rule", **_rule_entry(broken))
        return str(broken)

    def _goals(self, request: str) -> list[str]:
        """Return the rooms that a request may mean, as rules name them."""
        rooms = [] if self._room_map is None else self._room_map.rooms_meant(request)
        return [*dict.fromkeys(name_of(room, request) for room in rooms)]

    def _ask_room(self) -> str | None:
        """Ask the robot once in which of its rooms it is; None if it cannot say."""
        if self._has_asked or ROOM_SKILL not in self.skills or ROOM_SKILL in self.robot.missing:
            return None
        self._has_asked = True
        try:
            here = str(answered(self.skills[ROOM_SKILL], self.robot.perform(ROOM_SKILL, ()))).strip()
        except (RobotError, CancelledError):
            return None
        listed = (here,) if self._room_map is None else self._room_map.rooms
        room = next((room for room in listed if room.strip().casefold() == here.casefold()), "")
        words = name_of(room, self._place)
        return (words if words in self._goals(self._place) else room) or None

    def _logged(self, skill: Skill, given: list[base.RobotArgument], event: Event | None) -> base.RobotResult:
        """The robot's answer or its error, logged."""
        self._number += 1
        which = {"number": self._number, "skill": skill.name}
        named = dict(zip((p.name for p in skill.parameters), given, strict=True))
        at = {} if self.line is None else {"line": self.line}
        self._note("skill", **which, **at, arguments=named)
        started = self.now
        try:
            result = self._done(skill, given, event)
            if event is not None and event.options:
                _position(result, event)
        except RobotError as error:
            self._note("error", **which, kind=error.kind, message=str(error))
            self._check_end()
            raise
        except CancelledError:
            self._note("cancelled", **which, seconds=round(self.now - started, 3))
            self._check_end()
            raise RobotLostError("another client stopped the robot") from None
        self._note("late" if self._stopped.is_set() else "result", **which, result=result)
        self._check_end()
        return result

    def _done(self, skill: Skill, given: list[base.RobotArgument], event: Event | None) -> base.RobotResult:
        which = {"number": self._number, "skill": skill.name}

        def told(what: str | CameraPicture) -> None:
            try:
                if isinstance(what, CameraPicture):
                    self._note("picture", **which, picture=what.data)
                else:
                    if not self._is_watched and (found := AT.fullmatch(what)):
                        self._moved((float(found[1]), float(found[2])))
                    self._note("feedback", **which, text=what)
            except OSError as error:  # on a thread of the robot, where it would be lost
                self._fault = error
                self.stop()

        if event is not None and skill.recording and skill.recording.options and not event.options:
            raise RobotError("AskEmptyOptions", f'the question "{event.text}" offers no options')
        return answered(skill, self.robot.perform(skill.name, given, told))

    def _check_end(self) -> None:
        """Raise what ends the program, if anything does."""
        if self._began is None:
            self._began = self.robot.clock.now
            watch = getattr(self.robot, "watch", None)  # which some robots have
            if watch is not None and self._guard is not None and self._guard.judges_poses:
                self._is_watched = watch(self._moved)
        if self._fault is not None:
            raise self._fault
        if self._stopped.is_set():
            raise StoppedError


def answered(skill: Skill, result: base.RobotResult) -> base.RobotResult:
    """A robot's answer; raises RobotLostError if it does not fit the skill."""
    if not skill.returns.fits(result):
        expected = skill.returns.annotation
        raise RobotLostError(
            f"the robot answered {skill.name} with {result!r:.100}, where {expected} is expected"
        )
    return result


def _rule_entry(broken: RuleViolationError) -> dict[str, object]:
    """The log entry of a rule that was broken, or would have been."""
    rule, event = broken.rule, broken.event
    what = {} if event is None else {"what": trace_data((event,))[0], "prevented": not broken.is_late}
    why = {"why": broken.why} if broken.why else {}
    return {"rule": rule.name, "says": rule.says, "formula": str(rule.formula), **what, **why}


def _text(argument: Argument) -> base.RobotArgument:
    if not isinstance(argument, tuple):
        return argument
    return tuple(each.text if isinstance(each, Option) else each for each in argument)


def _position(result: base.RobotResult, event: Event) -> int:
    """The number of the chosen option; its case and blanks may differ. Raises RobotError if it is none."""
    heard = str(result)
    for same in (str, lambda text: text.strip().casefold()):
        for number, option in enumerate(event.options):
            if same(option.text) == same(heard):
                return number
    offered = ", ".join(option.text for option in event.options)
    raise RobotError(
        "AskInvalidOptions", f'the answer "{heard}" to "{event.text}" is not one of the options ({offered})'
    )
