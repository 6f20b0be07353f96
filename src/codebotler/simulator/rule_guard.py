"""`RuleGuard`: keeps a robot from breaking house rules, whatever its program asks for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, field, replace

from codebotler.core.errors import RobotError
from codebotler.core.labels import PLAIN_LABEL
from codebotler.core.skills.kinds import GOTO, INSIDE, PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.trace import Event, attempted_event
from codebotler.core.world import Point, Room, rooms_along
from codebotler.rtl import Inconclusive, Monitor
from codebotler.simulator.house_rule import NO_TEXT, Objection, Rule, RuleViolationError
from codebotler.simulator.robot import Argument, Result, SimulatedRobot, Thing

MOVES = {PICK, PLACE}  # kinds of events


def name_of(label: str, request: str) -> str:
    """Return the name by which rules compare a room or thing: its own, or the request if that is a regex."""
    is_name = PLAIN_LABEL.fullmatch(label) or not request or label.casefold() in request.casefold()
    return label if is_name else request


@dataclass
class _History:
    """What has happened, in the one way in which rules see it.

    Args:
        monitors: one for each rule.
        names: by which rules compare rooms, once the robot has driven there.
        unjudged: the names of rules that could not be judged.
        inside: the rooms that hold the robot's pose.
        holding: what the robot holds, by the name that rules compare.
    """

    monitors: Sequence[tuple[Rule, Monitor]]
    names: dict[str, str] = field(default_factory=dict)
    unjudged: set[str] = field(default_factory=set)
    inside: Sequence[str] = ()
    holding: str = ""

    def copy(self) -> _History:
        """Return a history that goes on by itself."""
        monitors = [(rule, copy(monitor)) for rule, monitor in self.monitors]
        return replace(self, monitors=monitors, names=dict(self.names), unjudged=set(self.unjudged))

    def named(self, event: Event, request: str, thing: Thing | None = None) -> Event:
        """Return an event with the names that rules compare.

        Args:
            event: what the robot recorded.
            request: the words for where it drove.
            thing: what it picked up or put down, if known.
        """
        text, place = event.text, self.names.get(event.place, event.place)
        holding = (self.holding or event.holding) if event.holding else ""
        if event.destination is not None:
            text = name_of(event.destination, request)
        elif thing is not None and event.kind in MOVES:
            text = name_of(thing.label, text)
        if (text, place, holding) == (event.text, event.place, event.holding):
            return event
        return replace(event, text=text, place=place, holding=holding)

    def judge(self, attempts: Iterable[Event]) -> None:
        """RuleViolationError if a rule would be broken by the next event, which may be any of several."""
        caught: RuleViolationError | None = None
        attempts = tuple(map(_trimmed, attempts))
        for rule, monitor in self.monitors:
            for attempt in attempts if rule.when == "always" else ():
                objection = _objection(rule, monitor, attempt)
                if objection is not None:
                    why = NO_TEXT if objection == "cannot judge" else ""
                    broken = RuleViolationError(rule, attempt, objection, why)
                    if broken.ends_run:
                        raise broken
                    caught = caught or broken  # another rule may end the run
        if caught is not None:
            raise caught

    def feed(self, event: Event) -> None:
        """Take what has happened; RuleViolationError if that broke a rule, which nobody could foresee."""
        if event.destination is not None:
            self.names[event.destination] = event.text
        elif event.kind in MOVES:
            self.holding = event.text if event.kind == PICK else ""
        late: RuleViolationError | None = None
        event = _trimmed(event)
        for rule, monitor in self.monitors:
            if event.kind == INSIDE and not rule.inside:  # other rules must not see it as the last event
                continue
            try:
                holds = monitor.feed(event)
            except Inconclusive:
                self.unjudged.add(rule.name)
                holds = False
            if not holds and rule.when == "always" and late is None:
                late = RuleViolationError(rule, event, "is broken by")
        if late is not None:
            raise late

    def enter(self, way: Iterable[Sequence[str]], holding: str) -> None:
        """Take each room that a way enters; RuleViolationError if that broke a rule."""
        for here in way:
            before, self.inside = self.inside, here
            for room in here:
                if room not in before:
                    self.feed(Event(INSIDE, room, place=room, holding=holding))

    def at_end(self) -> RuleViolationError | None:
        """Return the first rule that is not kept if the mission ends now."""
        for rule, monitor in self.monitors:
            if rule.when == "finally" and (rule.name in self.unjudged or not monitor.holds):
                return RuleViolationError(rule, None)
        return None


class RuleGuard:
    """Judges by rules all that one robot is to do, before it does it.

    Args:
        rules: the rules in force.
        rooms: the rooms with their footprints, as far as they are known.
    """

    def __init__(self, rules: Sequence[Rule], rooms: Sequence[Room] = ()) -> None:
        self.rules, self._rooms = tuple(rules), rooms
        self._stops = {room.name: room.stand_at for room in rooms}
        self._history = _History([(rule, Monitor(rule.formula)) for rule in rules])
        self._trial: _History | None = None  # during a call of a user's own skill
        self._start = self._seen = 0  # events before the call, and before what the trial has not seen
        self._held: Thing | None = None  # before the call
        self._prevented: list[RuleViolationError] = []  # within the call
        self.may_refuse = any(rule.refuse and rule.when == "always" for rule in rules)
        self.judges_poses = any(rule.inside for rule in rules)

    def perform(self, robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
        """Let a robot execute one skill; RuleViolationError if a rule forbids it, or was broken by it."""
        row, start, history = robot.skills[skill], len(robot.events), self._history
        holding = "" if robot.held is None else history.holding or robot.held
        place = history.names.get(robot.room, robot.room)
        attempt = attempted_event(row, arguments, place=place, time=robot.now, holding=holding)
        if attempt is not None:
            self.judge(*_attempts(robot, attempt, arguments, is_drive=row.is_drive))
        is_own = SKILLS.get(skill) is not row
        self._trial = history.copy() if is_own else None
        self._start = self._seen = start
        self._held = robot.taken
        self._prevented.clear()
        request = None if is_own or attempt is None else attempt.text
        try:
            result = robot.execute(skill, arguments)
        except RobotError:
            is_tried = row.recording is not None and row.recording.when_tried
            tried = [attempt] if attempt is not None and is_tried else []
            self._take(robot, robot.events[start:] or tried, history, request)
            if self._prevented:
                raise self._prevented[0] from None
            raise
        self._take(robot, robot.events[start:], history, request)
        if self._prevented:  # the function of the skill has caught it
            raise self._prevented[0]
        return result

    def judge_inside(self, robot: SimulatedRobot, event: Event) -> None:
        """RuleViolationError if a rule would be broken by what a user's own skill is about to do inside.

        What happens inside counts on trial: the result of the skill itself, which may come first, is not
        known before the call ends.
        """
        trial = self._trial
        if trial is None:
            return
        earlier, self._seen = robot.events[self._seen :], len(robot.events)
        try:
            self._take(robot, earlier, trial)
            named = trial.named(event, event.text)
            trial.judge(_attempts(robot, named, (), is_drive=named.kind == GOTO))
        except RuleViolationError as broken:
            self._prevented.append(broken)
            raise

    def _take(
        self,
        robot: SimulatedRobot,
        events: Sequence[Event],
        history: _History,
        request: str | None = None,
    ) -> None:
        """Add events of a call to a history; `request` is where it drives, if events may not tell."""
        kinds = [event.kind for event in robot.events[self._start :]]
        thing = self._held or robot.taken if sum(kind in MOVES for kind in kinds) == 1 else None
        for event in events:
            named = history.named(event, event.text if request is None else request, thing)
            is_leg = event.kind == GOTO or GOTO not in kinds
            if event.destination is not None and is_leg and self.judges_poses:
                history.enter(self._way(event.place, event.destination), named.holding)
            history.feed(named)

    def _way(self, start: str, end: str) -> Iterable[Sequence[str]]:
        """Return the rooms that hold each part of a simulated drive; only its ends without a map."""
        one, other = self._stops.get(start), self._stops.get(end)
        return [(start,), (end,)] if one is None or other is None else rooms_along(self._rooms, one, other)

    def moved(self, start: Point, end: Point, holding: str) -> None:
        """Take a straight way that the robot's pose has gone; RuleViolationError if that broke a rule."""
        if self.judges_poses:
            self._history.enter(rooms_along(self._rooms, start, end), holding)

    def judge(self, *attempts: Event) -> None:
        """RuleViolationError if a rule would be broken by the next event, which may be any of several."""
        self._history.judge(attempts)

    def happened(self, event: Event) -> None:
        """Take what has happened; RuleViolationError if that broke a rule, which nobody could foresee."""
        self._history.feed(event)

    def give_up(self, rules: Iterable[Rule], event: Event, objection: Objection, why: str) -> None:
        """Take that some rules cannot be judged any more; RuleViolationError if one is not of the end."""
        for rule in rules:
            self._history.unjudged.add(rule.name)
            if rule.when == "always":
                raise RuleViolationError(rule, event, objection, why)

    def at_end(self) -> RuleViolationError | None:
        """Return the first rule that is not kept if the mission ends now."""
        return self._history.at_end()


def _trimmed(event: Event) -> Event:
    """Return an event whose options, answer and person have no blanks at their ends."""
    if event.to is None and not event.options:
        return event
    options = tuple([option._replace(text=option.text.strip()) for option in event.options])
    answer, to = (None if text is None else text.strip() for text in (event.answer, event.to))
    return replace(event, options=options, answer=answer, to=to)


def _objection(rule: Rule, monitor: Monitor, attempt: Event) -> Objection | None:
    """Return what a rule has against an event, whatever its result will be."""
    is_unclear = False
    for event in rule.results(attempt):
        try:
            if monitor.would_hold(event):
                return None
        except Inconclusive:
            is_unclear = True
    return "cannot judge" if is_unclear else "forbids"


def _attempts(
    robot: SimulatedRobot, attempt: Event, arguments: Sequence[Argument], *, is_drive: bool
) -> Iterator[Event]:
    """Yield an attempt, and the same with the names of the rooms or things that it may mean."""
    yield attempt
    meant: list[str] = []
    for request in dict.fromkeys((attempt.text, *(each for each in arguments if isinstance(each, str)))):
        if is_drive:
            meant += [name_of(room, request) for room in robot.meant_rooms(request)]
        else:
            meant += _moved(robot, attempt.kind, request)
    for name in dict.fromkeys(meant):
        if name != attempt.text:
            yield replace(attempt, text=name)


def _moved(robot: SimulatedRobot, kind: str, request: str) -> Sequence[str]:
    """Return by which name the thing is recorded that would be picked up or put down."""
    things = [robot.taken] if kind == PLACE and robot.taken is not None else []
    if kind == PICK:
        here = robot.things[robot.room]
        things = [thing for thing in here if thing.is_meant_by(request, robot.rules.matching)][:1]
    as_happened = robot.rules.events == "as-happened"
    return [thing.label if as_happened else name_of(thing.label, request) for thing in things]
