"""`RuleGuard`: prevents a robot from breaking house rules, whatever its program does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, field, replace

from codebotler.core.errors import RobotError
from codebotler.core.skills.declaration import by_event
from codebotler.core.skills.kinds import GOTO, INSIDE, PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.text.labels import PLAIN_LABEL
from codebotler.core.trace import Event, attempted_event
from codebotler.core.world import Point, rooms_along
from codebotler.rtl import Inconclusive, Monitor
from codebotler.simulator.guard.contract import Contract, RequestedCall, contract_violation, is_goal
from codebotler.simulator.guard.house_rule import NON_TEXT_OPTION, UNKNOWN_ROOM, Rule, RuleViolationError
from codebotler.simulator.worlds.entities import Thing
from codebotler.simulator.worlds.robot import Argument, Result, SimulatedRobot
from codebotler.simulator.worlds.room_map import NO_ROOMS, RoomMap

KINDS_OF_MOVES = {PICK, PLACE}


def name_of(label: str, request: str) -> str:
    """Return the name to check against rules: the label in the world or, if it is a regex, the request."""
    is_name = PLAIN_LABEL.fullmatch(label) or not request or label.casefold() in request.casefold()
    return label if is_name else request


def rooms_meant(robot: SimulatedRobot, request: str) -> list[str]:
    """Return all rooms to which a drive with this request may lead, under their names in rules."""
    return [name_of(robot.full_names.get(room, room), request) for room in robot.possible_rooms(request)]


def goals_of_call(robot: SimulatedRobot, row: Skill, arguments: Sequence[Argument]) -> list[str]:
    """Return the rooms to which a call may drive, under their names in rules; empty if it is not a drive."""
    given = zip(row.parameters, arguments, strict=True)
    goals = (one for parameter, one in given if is_goal(row, parameter.name))
    return [room for goal in goals for room in rooms_meant(robot, str(goal))]


@dataclass
class _History:
    """The events so far, with the names that rules compare."""

    monitors: Sequence[tuple[Rule, Monitor]]
    names: dict[str, str] = field(default_factory=dict)  # names of the visited rooms
    unjudged: set[str] = field(default_factory=set)  # names of rules that can no longer be judged
    inside: Sequence[str] = ()  # the rooms that contain the robot's pose
    holding: str = ""

    def copy(self) -> _History:
        """Return an independent copy of this history."""
        monitors = [(rule, copy(monitor)) for rule, monitor in self.monitors]
        return replace(self, monitors=monitors, names=dict(self.names), unjudged=set(self.unjudged))


class RuleGuard:
    """Judges each action of one robot by house rules before it happens, given all earlier events.

    Args:
        rules: the rules in force.
        room_map: the known rooms and their footprints, and what happened before the program began.
        contracts: limits on what the program may do. Each call must respect all of them.
    """

    def __init__(
        self, rules: Sequence[Rule], room_map: RoomMap = NO_ROOMS, contracts: Sequence[Contract] = ()
    ) -> None:
        rooms = room_map.plan
        self.rules, self._rooms, self.contracts = tuple(rules), rooms, tuple(contracts)
        self._calls: Counter[str] = Counter()  # by skill
        self._stops = {room.full_name: room.stand_at for room in rooms}
        self._around = {
            name: room.within for room in rooms if room.within for name in (room.name, room.full_name)
        }
        self.may_refuse = any(rule.refuse and rule.when != "finally" for rule in rules)
        self.judges_poses = any(rule.inside for rule in rules)
        self._history = _History([(rule, Monitor(rule.formula)) for rule in rules])

        # The current skill call.
        self._is_own = False  # whether it is a custom skill, whose events are provisional until it ends
        self._start = self._seen = 0  # number of events before the call, and of events judged so far
        self._held: Thing | None = None  # what the robot held before the call
        self._prevented: RuleViolationError | None = None  # the skill may have caught it
        self._recall(room_map)

    def _recall(self, room_map: RoomMap) -> None:
        """Add what happened before the program began to the history, without an objection."""
        for event in room_map.past:
            if event.failed and not _counts_attempts(event.kind):
                continue
            place = _label(room_map, event.place)
            named = replace(event, place=name_of(place, event.place))
            if event.kind == GOTO and not event.failed:
                goal = _label(room_map, event.text)
                named = replace(named, text=name_of(goal, event.text), destination=goal)
                for inside in self._entered(self._way(place, goal), event.holding):
                    self.add_event(inside)
            self.add_event(named)

    def perform(self, robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
        """Let a robot execute one skill. Raise RuleViolationError if the call or its result breaks a rule."""
        row, start = robot.skills[skill], len(robot.events)
        holding = "" if robot.held is None else self._history.holding or robot.held
        place = self._history.names.get(robot.place, robot.place)
        self.judge_call(row, arguments, goals_of_call(robot, row, arguments), place)
        attempt = attempted_event(row, arguments, place=place, time=robot.now, holding=holding)
        if attempt is not None:
            attempts = _attempts(robot, attempt, arguments, is_drive=row.is_drive)
            self.judge(*attempts, is_drive=row.is_drive)
        self._is_own = SKILLS.get(skill) is not row
        self._start, self._seen, self._held, self._prevented = start, start, robot.taken, None
        request = None if self._is_own or attempt is None else attempt.text
        try:
            result = self._execute(robot, skill, arguments)
        except RobotError:
            events = robot.events[start:]
            is_tried = row.recording is not None and row.recording.judged_when_tried
            if attempt is not None and is_tried and all(event.kind != attempt.kind for event in events):
                events.append(attempt)
            self._take(robot, events, request)
            if self._prevented is not None:
                raise self._prevented from None
            raise
        self._take(robot, robot.events[start:], request)
        if self._prevented is not None:
            raise self._prevented
        return result

    def _execute(self, robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
        history = self._history
        if self._is_own:
            self._history = history.copy()
        try:
            return robot.execute(skill, arguments)
        finally:
            self._history = history

    def judge_inside(self, robot: SimulatedRobot, event: Event) -> None:
        """Raise RuleViolationError if the next event inside a custom skill would break a rule."""
        # Events inside a skill are provisional: the skill's own event may come before them, but its result is
        # not known until the call ends.
        if not self._is_own:
            return
        earlier, self._seen = robot.events[self._seen :], len(robot.events)
        try:
            self._take(robot, earlier)
            named = self._named(event, event.text)
            is_drive = named.kind == GOTO
            self.judge(*_attempts(robot, named, (), is_drive=is_drive), is_drive=is_drive)
        except RuleViolationError as broken:
            self._prevented = self._prevented or broken
            raise

    def judge_call(self, row: Skill, arguments: Sequence[Argument], goals: Sequence[str], place: str) -> None:
        """Count the next call, or raise RuleViolationError if a contract does not allow it.

        `goals` is from `goals_of_call`. `place` is the robot's room, or "" if it is unknown.
        """
        for contract in self.contracts:
            call = RequestedCall.of(row, arguments, goals, place)
            if why := contract.objection(call, self._calls[row.name]):
                raise contract_violation(row, arguments, place, why)
        self._calls[row.name] += 1

    def judge(self, *attempts: Event, is_drive: bool = False) -> None:
        """Raise RuleViolationError if a possible next event (a drive if `is_drive`) would break a rule."""
        found = list(self.find_violations(attempts, is_drive=is_drive))
        if found:
            raise min(found, key=lambda broken: not broken.ends_run)  # another rule may end the run

    def find_violations(self, attempts: Sequence[Event], *, is_drive: bool) -> Iterator[RuleViolationError]:
        """Yield an error for each rule that a possible next event (a drive if `is_drive`) would break."""
        attempts = tuple(map(_trimmed, attempts))
        leaves = is_drive and any(map(self._leaves, attempts[1:] or attempts))
        # Robots and contracts take names that differ only in white space for the same.
        attempts = (*attempts, *(folded for one in attempts for folded in _folded(one)))
        for rule, monitor in self._history.monitors:
            is_judged = rule.when == "always" or (rule.when == "leaving" and leaves)
            for attempt in attempts if is_judged else ():
                if rule.when == "always":
                    broken = _violation(rule, monitor, attempt)
                else:
                    broken = None if self._is_kept(rule, monitor) else RuleViolationError(rule, attempt)
                if broken is not None:
                    yield broken

    def _leaves(self, drive: Event) -> bool:
        """Return whether a drive ends outside the room where it begins."""
        goal, place = (self._around.get(name, name) for name in (drive.text, drive.place))
        return goal.casefold() != place.casefold()

    def judge_result(self, event: Event) -> None:
        """Add a completed event to the history. Raise RuleViolationError if its result broke a rule."""
        if broken := self.add_event(event):
            raise broken[0]

    def add_event(self, event: Event) -> list[RuleViolationError]:
        """Add a completed event to the history, and return an error for each rule that its result broke."""
        if event.destination is not None:
            self._history.names[event.destination] = event.text
        elif event.kind in KINDS_OF_MOVES:
            self._history.holding = event.text if event.kind == PICK else ""
        late = []
        event = _trimmed(event)
        for rule, monitor in self._history.monitors:
            if event.kind == INSIDE and not rule.inside:  # must not count as the last event for other rules
                continue
            try:
                holds = monitor.feed(event)
            except Inconclusive:
                self._history.unjudged.add(rule.name)
                holds = False
            if not holds and rule.when == "always":
                late.append(RuleViolationError(rule, event, "is broken by"))
        return late

    def record_drive(self, start: Point, end: Point, holding: str) -> None:
        """Record the rooms entered on a drive while `holding` a thing. Raise an error if a rule is broken."""
        if self.judges_poses:
            for event in self._entered(rooms_along(self._rooms, start, end), holding):
                self.judge_result(event)

    def give_up(self, rules: Iterable[Rule], event: Event) -> None:
        """Stop judging these rules because the event's room is unknown. Raise an error for `always` rules."""
        for rule in rules:
            self._history.unjudged.add(rule.name)
            if rule.when == "always":
                raise RuleViolationError(rule, event, "cannot judge", UNKNOWN_ROOM)

    def find_first_unkept(self) -> RuleViolationError | None:
        """Return an error for the first rule that is broken if the mission ends now, or None."""
        return next(self.find_unkept(), None)

    def find_unkept(self) -> Iterator[RuleViolationError]:
        """Yield an error for each rule that is broken if the mission ends now."""
        for rule, monitor in self._history.monitors:
            if rule.when != "always" and not self._is_kept(rule, monitor):
                yield RuleViolationError(rule, None)

    def _is_kept(self, rule: Rule, monitor: Monitor) -> bool:
        return monitor.holds and rule.name not in self._history.unjudged

    def _take(self, robot: SimulatedRobot, events: Sequence[Event], request: str | None = None) -> None:
        """Add the current call's events to the history. `request` is the goal of a built-in drive."""
        kinds = [event.kind for event in robot.events[self._start :]]
        is_one_move = sum(kind in KINDS_OF_MOVES for kind in kinds) == 1
        thing = self._held or robot.taken if is_one_move else None
        for event in events:
            named = self._named(event, event.text if request is None else request, thing)
            is_leg = event.kind == GOTO or GOTO not in kinds
            if event.destination is not None and is_leg and self.judges_poses:
                for inside in self._entered(self._way(event.place, event.destination), named.holding):
                    self.judge_result(inside)
            self.judge_result(named)

    def _named(self, event: Event, request: str, thing: Thing | None = None) -> Event:
        """Return a robot's event with the names that rules compare."""
        text, place = event.text, self._history.names.get(event.place, event.place)
        holding = (self._history.holding or event.holding) if event.holding else ""
        if event.destination is not None:
            text = name_of(event.destination, request)
        elif thing is not None and event.kind in KINDS_OF_MOVES:
            text = name_of(thing.label, text)
        return replace(event, text=text, place=place, holding=holding)

    def _entered(self, way: Iterable[Sequence[str]], holding: str) -> Iterator[Event]:
        """Yield an event for each room that the robot enters on its way."""
        for here in way:
            before, self._history.inside = self._history.inside, here
            for room in here:
                if room not in before:
                    yield Event(INSIDE, room, place=room, holding=holding)

    def _way(self, start: str, end: str) -> Iterable[Sequence[str]]:
        """Return the rooms that contain each part of a simulated drive, or only its ends without a map."""
        one, other = self._stops.get(start), self._stops.get(end)
        return [(start,), (end,)] if one is None or other is None else rooms_along(self._rooms, one, other)


def _counts_attempts(kind: str) -> bool:
    """Return whether house rules count failed attempts of the skill that records a kind of event."""
    row = by_event(kind)
    return row is not None and row.recording is not None and row.recording.judged_when_tried


def _label(room_map: RoomMap, request: str) -> str:
    room = room_map.room(request)
    return request if room is None else room_map.full_name(room)


def _trimmed(event: Event) -> Event:
    """Strip surrounding whitespace from an event's options, answer and person."""
    if event.to is None and not event.options:
        return event
    options = tuple([option._replace(text=option.text.strip()) for option in event.options])
    answer, to = (None if text is None else text.strip() for text in (event.answer, event.to))
    return replace(event, options=options, answer=answer, to=to)


def _folded(event: Event) -> list[Event]:
    """Return the event with single spaces in its texts; empty if it has no other white space."""
    options = tuple([option._replace(text=_fold(option.text)) for option in event.options])
    more, person = tuple(map(_fold, event.more)), None if event.to is None else _fold(event.to)
    names = {"text": _fold(event.text), "place": _fold(event.place), "holding": _fold(event.holding)}
    changed = {**names, "more": more, "to": person, "options": options}
    is_same = all(getattr(event, name) == value for name, value in changed.items())
    return [] if is_same else [replace(event, **changed)]  # type: ignore[arg-type]  # of several types


def _fold(text: str) -> str:
    return " ".join(text.split())


def _violation(rule: Rule, monitor: Monitor, attempt: Event) -> RuleViolationError | None:
    """Return an error if a rule forbids an event whatever its result, else None."""
    is_unclear = False
    for event in rule.results(attempt):
        try:
            if monitor.would_hold(event):
                return None
        except Inconclusive:
            is_unclear = True
    if is_unclear:
        return RuleViolationError(rule, attempt, "cannot judge", NON_TEXT_OPTION)
    return RuleViolationError(rule, attempt)


def _attempts(
    robot: SimulatedRobot, attempt: Event, arguments: Sequence[Argument], *, is_drive: bool
) -> Iterator[Event]:
    """Yield an attempt, and a copy for each name of a room or thing that it may refer to."""
    yield attempt
    names: list[str] = []
    for request in dict.fromkeys((attempt.text, *(each for each in arguments if isinstance(each, str)))):
        if is_drive:
            names += rooms_meant(robot, request)
        else:
            names += _names_of_thing(robot, attempt.kind, request)
    for name in dict.fromkeys(names):
        if name != attempt.text:
            yield replace(attempt, text=name)


def _names_of_thing(robot: SimulatedRobot, kind: str, request: str) -> Sequence[str]:
    """Return the recorded name of the thing that would be picked up or put down, or nothing."""
    things = [robot.taken] if kind == PLACE and robot.taken is not None else []
    if kind == PICK:
        with suppress(RobotError):  # several things match; the skill will fail
            things = [thing for thing in [robot.thing_meant(request)] if thing is not None]
    as_happened = robot.settings.events == "as-happened"
    return [thing.label if as_happened else name_of(thing.label, request) for thing in things]
