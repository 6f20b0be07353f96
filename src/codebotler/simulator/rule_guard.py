"""`RuleGuard`: keeps a robot from breaking house rules, whatever its program asks for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import VIOLATION, RobotError
from codebotler.core.phrases import phrase
from codebotler.core.skills.kinds import GOTO, INSIDE, PICK, PLACE
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Skill
from codebotler.core.trace import Event, Names, attempted
from codebotler.core.world import Point, Room, rooms_along
from codebotler.rtl import EventPattern, Formula, Inconclusive, Monitor
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.simulator.robot import Argument, Result, SimulatedRobot, Thing

MOVES = {PICK, PLACE}  # kinds of events
Verdict: TypeAlias = Literal["forbids", "cannot judge", "is broken by"]
Watched: TypeAlias = "tuple[Rule, Monitor, frozenset[str]]"  # the last: see `_depends_on`


@dataclass(frozen=True)
class Rule:
    """What must hold whatever the instruction is.

    Args:
        name: how messages name it.
        says: the rule for people and models, in a sentence.
        formula: the rule as a formula.
        when: `always`, of every prefix of a trace, or `finally`, when the mission ends.
        refuse: whether the program goes on without what it was refused; else the mission ends.
        any_room: whether it may name rooms that a house lacks.
    """

    name: str
    says: str
    formula: Formula
    when: Literal["always", "finally"] = "always"
    refuse: bool = False
    any_room: bool = False

    @cached_property
    def inside(self) -> tuple[EventPattern, ...]:
        """Its elements that are about the rooms which the robot's pose enters."""
        return tuple(element for element in elements(self.formula) if element.kind == INSIDE)


class RuleViolationError(RobotError):
    """A rule would be broken, or has been.

    Args:
        rule: the rule.
        event: what would break it, or has broken it; None at the end of a mission.
        verdict: what it has to do with the event.
    """

    def __init__(self, rule: Rule, event: Event | None, verdict: Verdict = "forbids") -> None:
        what = "is not kept at the end" if event is None else f"{verdict} {phrase(event, 'ing')}"
        why = ", which offers an option that is no text" if verdict == "cannot judge" else ""
        super().__init__(VIOLATION, f'the rule "{rule.name}" {what}{why}: {rule.says.rstrip(".")}')
        self.rule, self.event, self.verdict = rule, event, verdict

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.rule, self.event, self.verdict), vars(self)

    @property
    def is_late(self) -> bool:
        """Whether the event has happened already."""
        return self.verdict == "is broken by"

    @property
    def ends_run(self) -> bool:
        """Whether the program cannot go on, whatever it catches."""
        return self.is_late or not self.rule.refuse


class RuleGuard:
    """Judges by rules all that one robot is to do, before it does it.

    Args:
        rules: the rules in force.
        rooms: the rooms with their footprints, as far as they are known.
    """

    def __init__(self, rules: Sequence[Rule], rooms: Sequence[Room] = ()) -> None:
        self.rules, self._rooms = tuple(rules), rooms
        self._inside: Sequence[str] = ()  # the rooms that hold the robot's pose
        self._watch([(rule, Monitor(rule.formula), _depends_on(rule)) for rule in rules])
        self._unjudged: set[str] = set()  # names of rules that had to compare an option that is no text
        self._here = ""  # the room, as rules name it
        self._call: tuple[Skill, int, Thing | None, Event | None] | None = None  # of a user's own skill
        self._prevented: list[RuleViolationError] = []  # within that call

    def _watch(self, watched: Iterable[Watched]) -> None:
        """Go on with monitors; of one rule there are several where it is uncertain what has happened."""
        self._always: list[Watched] = []
        self._finally: list[Watched] = []
        for each in watched:
            (self._always if each[0].when == "always" else self._finally).append(each)

    @property
    def may_refuse(self) -> bool:
        """Whether a program may go on after something was refused."""
        return any(rule.refuse for rule, _, _ in self._always)

    def perform(self, robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
        """Let a robot execute one skill; RuleViolationError if a rule forbids it, or was broken by it."""
        row, before = robot.skills[skill], len(robot.events)
        if self._here != robot.room:
            self._here = robot.room
        thing, held = robot.taken, robot.held or ""
        holding = held if thing is None else names_of(thing.label, held)
        attempt = attempted(row, arguments, place=self._here, time=robot.now, holding=holding)
        if attempt is not None:
            self.judge(*_attempts(robot, attempt, arguments, is_drive=row.is_drive))
        self._call = None if SKILLS.get(skill) is row else (row, before, thing, attempt)
        self._prevented.clear()
        try:
            result = robot.execute(skill, arguments)
        except RobotError:
            tried = [attempt] if attempt is not None and _is_tried(row) else []
            for event in self._named(robot, row, robot.events[before:] or tried, thing, attempt, failed=True):
                self.happened(event)
            if self._prevented:
                raise self._prevented[0] from None
            raise
        for event in self._named(robot, row, robot.events[before:], thing, attempt):
            self.happened(event)
        if self._prevented:  # the function of the skill has caught it
            raise self._prevented[0]
        return result

    def judge_inside(self, robot: SimulatedRobot, event: Event) -> None:
        """RuleViolationError if a rule would be broken by what a user's own skill is about to do inside."""
        if self._call is None:
            return
        row, before, thing, attempt = self._call
        here, inside, watched = self._here, self._inside, [*self._always, *self._finally]
        self._watch([(rule, copy(monitor), depends) for rule, monitor, depends in watched])
        try:
            events = [*robot.events[before:], event]
            *earlier, now = self._named(robot, row, events, thing, attempt, failed=True)
            for each in earlier:
                self.happened(each)
            self.judge(*_attempts(robot, now, (), is_drive=now.kind == GOTO))
        except RuleViolationError as broken:
            self._prevented.append(broken)
            raise
        finally:  # what has happened is taken in for good when the call has ended, with its result
            self._here, self._inside = here, inside
            self._watch(watched)

    def _named(
        self,
        robot: SimulatedRobot,
        row: Skill,
        events: Sequence[Event],
        thing: Thing | None,
        attempt: Event | None,
        *,
        failed: bool = False,
    ) -> Iterator[Event]:
        """What has happened in a call, by all names of rooms and things; before, the robot held `thing`."""
        start, own = self._here, _own_event(row, events, attempt, failed=failed)
        moved = thing or robot.taken if sum(event.kind in MOVES for event in events) == 1 else None
        for number, event in enumerate(events, 1):
            text, asked = event.text, attempt.text if event is own and attempt is not None else event.text
            place = next((name for name in (start, self._here) if name == event.place), event.place)
            holding = (
                attempt.holding if attempt is not None and attempt.holding == event.holding else event.holding
            )
            is_drive = event.kind == GOTO or (event is own and row.is_drive)
            if is_drive and not (failed and (event is own or number == len(events))):
                later = (each.place for each in events[number:] if event is not own and each is not own)
                left, self._here = self._here, names_of(next(later, robot.room), asked)
                text = self._here
                yield from self._entered(self._way(left, text), holding)
            elif moved is not None and event.kind in MOVES:
                text = names_of(moved.label, asked)
            if text is event.text and place is event.place and holding is event.holding:
                yield event
            else:
                yield replace(event, text=text, place=place, holding=holding)

    def moved(self, start: Point, end: Point, holding: str) -> None:
        """Take a straight way that the robot's pose has gone; RuleViolationError if that broke a rule."""
        for event in self._entered(rooms_along(self._rooms, start, end), holding):
            self.happened(event)

    def _way(self, start: str, end: str) -> Iterable[Sequence[str]]:
        """The rooms that hold each part of a simulated drive; only its ends where no map is known."""
        stops = {room.name: room.stand_at for room in self._rooms}
        one, other = stops.get(start), stops.get(end)
        return [(start,), (end,)] if one is None or other is None else rooms_along(self._rooms, one, other)

    def _entered(self, way: Iterable[Sequence[str]], holding: str) -> Iterator[Event]:
        """An event for each room that a way enters, if a rule is about that."""
        for here in way if any(rule.inside for rule in self.rules) else ():
            before, self._inside = self._inside, here
            yield from (Event(INSIDE, r, place=r, holding=holding) for r in here if r not in before)

    @property
    def judges_poses(self) -> bool:
        """Whether a rule is about where the robot is."""
        return any(rule.inside for rule in self.rules)

    def judge(self, *attempts: Event) -> None:
        """RuleViolationError if a rule would be broken by the next event, which may be any of several."""
        caught: RuleViolationError | None = None
        attempts = tuple(map(_trimmed, attempts))
        for rule, monitor, depends in self._always:
            for attempt in attempts:
                if attempt.kind in depends:
                    can_hold = any(_would_hold(monitor, event) for event in _results(rule, attempt))
                else:
                    can_hold = _would_hold(monitor, attempt)
                if not can_hold:
                    unclear = _is_unclear(monitor, attempt)
                    broken = RuleViolationError(rule, attempt, "cannot judge" if unclear else "forbids")
                    if broken.ends_run:
                        raise broken
                    caught = caught or broken  # another rule may end the run
        if caught is not None:
            raise caught

    def happened(self, *possible: Event) -> None:
        """Take what has happened; RuleViolationError if that broke a rule, which nobody could foresee.

        Args:
            possible: the event; several if it is uncertain which of them it was. Then rules hold only if they
                do so whichever it was.
        """
        watched = [*self._always, *self._finally]
        if possible[0].kind == INSIDE:  # it would be the last event, for example, for other rules as well
            watched = [each for each in watched if each[0].inside]
        possible, late = tuple(map(_trimmed, possible)), None
        for event in possible[1:]:
            apart = [(rule, copy(monitor), depends) for rule, monitor, depends in watched]
            late = self._feed(apart, event) or late
            self._watch([*self._always, *self._finally, *apart])
        late = self._feed(watched, possible[0]) or late
        if len(possible) > 1:
            different = {(each[0].name, each[1].state): each for each in (*self._always, *self._finally)}
            self._watch(different.values())
        if late is not None:
            raise late

    def _feed(self, watched: Iterable[Watched], event: Event) -> RuleViolationError | None:
        """Tell monitors what has happened; the first rule that is broken now."""
        late: RuleViolationError | None = None
        for rule, monitor, _ in watched:
            try:
                holds = monitor.feed(event)
            except Inconclusive:
                self._unjudged.add(rule.name)
                holds = False
            if not holds and rule.when == "always" and late is None:
                late = RuleViolationError(rule, event, "is broken by")
        return late

    def at_end(self) -> RuleViolationError | None:
        """The first rule that is not kept if the mission ends now."""
        for rule, monitor, _ in self._finally:
            if rule.name in self._unjudged or not monitor.holds:
                return RuleViolationError(rule, None)
        return None


def _trimmed(event: Event) -> Event:
    """An event whose options, answer and person have no blanks at their ends."""
    if event.to is None and not event.options:
        return event
    options = tuple([option._replace(text=option.text.strip()) for option in event.options])
    answer, to = (None if text is None else text.strip() for text in (event.answer, event.to))
    return replace(event, options=options, answer=answer, to=to)


def _attempts(
    robot: SimulatedRobot, attempt: Event, arguments: Sequence[Argument], *, is_drive: bool
) -> Iterator[Event]:
    """An attempt, and the same with the other rooms or things that it may mean, outer spaces or not."""
    yield attempt
    meant: list[str] = []
    for request in dict.fromkeys((attempt.text, *(each for each in arguments if isinstance(each, str)))):
        meant += robot.meant_rooms(request) if is_drive else _moved(robot, attempt.kind, request)
    for name in dict.fromkeys(meant):
        if name != attempt.text:
            yield replace(attempt, text=names_of(name, attempt.text))


def _own_event(row: Skill, events: Sequence[Event], attempt: Event | None, *, failed: bool) -> Event | None:
    """Which of the events of a call is that of its skill, and not one of what the skill does inside."""
    if attempt is None or not events or (failed and row.adds_event and not _is_tried(row)):
        return None
    return events[-1 if row.adds_event and not _is_tried(row) else 0]


def _is_tried(row: Skill) -> bool:
    return row.recording is not None and row.recording.when_tried


def names_of(name: str, request: str) -> str:
    """A room or thing by its name, and by the words that asked for it where its name is a regex."""
    return name if not request or name.casefold() in request.casefold() else Names(name, request)


def _moved(robot: SimulatedRobot, kind: str, request: str) -> Sequence[str]:
    """By which name the thing is recorded that would be picked up or put down."""
    if kind == PLACE and robot.taken is not None:
        return (robot.taken.label,)
    here = robot.things[robot.room] if kind == PICK else ()
    return [thing.label for thing in here if thing.is_meant_by(request, robot.rules.matching)][:1]


def _is_unclear(monitor: Monitor, event: Event) -> bool:
    """Whether an event cannot be judged, since it has options that are no text."""
    try:
        monitor.would_hold(event)
    except Inconclusive:
        return True
    return False


def _would_hold(monitor: Monitor, event: Event) -> bool:
    try:
        return monitor.would_hold(event)
    except Inconclusive:
        return False


def _depends_on(rule: Rule) -> frozenset[str]:
    """The kinds of events whose results a rule compares."""
    found, answered = _results_of(rule)
    return found | answered


@lru_cache(maxsize=256)
def _results_of(rule: Rule) -> tuple[frozenset[str], frozenset[str]]:
    """The kinds of events of which a rule compares what a look finds, and what somebody answers."""
    wanted = [*elements(rule.formula)]
    found = frozenset(one.kind for one in wanted if one.found is not None)
    return found, frozenset(one.kind for one in wanted if one.answer is not None)


def _results(rule: Rule, attempt: Event) -> Sequence[Event]:
    """An event as it may turn out, as far as a rule tells that apart."""
    found, answered = _results_of(rule)
    if attempt.kind in found:
        return [replace(attempt, found=True), replace(attempt, found=False)]
    if attempt.kind in answered and attempt.options:
        return [replace(attempt, answer=option.text) for option in attempt.options]
    return (attempt,)
