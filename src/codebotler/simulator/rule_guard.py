"""`RuleGuard`: keeps a robot from breaking the rules of the house, whatever its program asks for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeAlias

from codebotler.core.errors import VIOLATION, RobotError
from codebotler.core.trace import Event, attempted
from codebotler.rtl import Formula, Inconclusive, Monitor
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.wording import event_words
from codebotler.simulator.robot import Argument, Result, SimulatedRobot

Verdict: TypeAlias = Literal["forbids", "cannot judge", "is broken by"]
Aliases: TypeAlias = tuple[Event, ...]
"""One event, by each of the names that its rooms and things go by."""


@dataclass(frozen=True)
class Rule:
    """What must hold whatever the instruction is.

    Args:
        name: how messages name it.
        says: the rule for people and models, in a sentence.
        formula: the rule as a formula.
        when: `always`, of every prefix of a trace, or `finally`, when the mission ends.
        refuse: whether the program goes on without what it was refused; else the mission ends.
    """

    name: str
    says: str
    formula: Formula
    when: Literal["always", "finally"] = "always"
    refuse: bool = False


class RuleViolationError(RobotError):
    """A rule would be broken, or has been.

    Args:
        rule: the rule.
        event: what would break it, or has broken it; None at the end of a mission.
        verdict: what it has to do with the event.
    """

    def __init__(self, rule: Rule, event: Event | None, verdict: Verdict = "forbids") -> None:
        what = "is not kept at the end" if event is None else f"{verdict} {event_words(event)}"
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
    """

    def __init__(self, rules: Sequence[Rule]) -> None:
        self.rules = tuple(rules)
        watched = [(rule, Monitor(rule.formula), _depends_on(rule)) for rule in rules]
        self._always = [each for each in watched if each[0].when == "always"]
        self._finally = [each for each in watched if each[0].when == "finally"]
        self._unjudged: set[str] = set()  # names of rules that had to compare an option that is no text
        self._came = ""  # the words of the last drive

    @property
    def may_refuse(self) -> bool:
        """Whether a program may go on after something was refused."""
        return any(rule.refuse for rule, _, _ in self._always)

    def perform(self, robot: SimulatedRobot, skill: str, arguments: Sequence[Argument]) -> Result:
        """Let a robot execute one skill; RuleViolationError if a rule forbids it, or was broken by it."""
        row, before = robot.skills[skill], len(robot.events)
        places = names_of(robot.room, self._came)
        attempt = attempted(row, arguments, place=robot.room, time=robot.now, holding=robot.held or "")
        if attempt is None:
            return robot.execute(skill, arguments)
        is_drive = row.recording is not None and row.recording.is_drive
        possible = _possible_names(robot, attempt, arguments, is_drive=is_drive)
        self.judge(*(aliases(attempt, names, places) for names in possible))
        try:
            result = robot.execute(skill, arguments)
        except RobotError:
            for event in robot.events[before:]:
                self.happened(*aliases(event, (event.text,), places))
            raise
        if is_drive:
            self._came = attempt.text
        for event in robot.events[before:]:
            what = robot.room if is_drive else event.text
            names = names_of(what, attempt.text) if event.kind == attempt.kind else (what,)
            self.happened(*aliases(event, names, places))
        return result

    def judge(self, *attempts: Aliases) -> None:
        """RuleViolationError if a rule would be broken by the next event, which may be any of several."""
        caught: RuleViolationError | None = None
        for rule, monitor, depends in self._always:
            for attempt in attempts:
                if attempt[0].kind in depends:
                    can_hold = any(_would_hold(monitor, event) for event in _results(rule, attempt))
                else:
                    can_hold = _would_hold(monitor, attempt)
                if not can_hold:
                    unclear = _is_unclear(monitor, attempt)
                    broken = RuleViolationError(rule, attempt[0], "cannot judge" if unclear else "forbids")
                    if broken.ends_run:
                        raise broken
                    caught = caught or broken  # another rule may end the run
        if caught is not None:
            raise caught

    def happened(self, event: Event, *others: Event) -> None:
        """Take what has happened; RuleViolationError if that broke a rule, which nobody could foresee.

        Args:
            event: what has happened.
            others: the same by other names.
        """
        late: RuleViolationError | None = None
        for rule, monitor, _ in (*self._always, *self._finally):
            try:
                holds = monitor.feed(event, *others)
            except Inconclusive:
                self._unjudged.add(rule.name)
                holds = False
            if not holds and rule.when == "always" and late is None:
                late = RuleViolationError(rule, event, "is broken by")
        if late is not None:
            raise late

    def at_end(self) -> RuleViolationError | None:
        """The first rule that is not kept if the mission ends now."""
        for rule, monitor, _ in self._finally:
            if rule.name in self._unjudged or not monitor.holds:
                return RuleViolationError(rule, None)
        return None


def _possible_names(
    robot: SimulatedRobot, attempt: Event, arguments: Sequence[Argument], *, is_drive: bool
) -> Iterator[Sequence[str]]:
    """The words of a request, and the names of each room or thing that it may mean, outer spaces or not."""
    yield (attempt.text,)
    meant: list[str] = []
    for request in dict.fromkeys((attempt.text, *(each for each in arguments if isinstance(each, str)))):
        meant += robot.meant_rooms(request) if is_drive else _moved(robot, attempt.kind, request)
    for name in dict.fromkeys(meant):
        if name != attempt.text:
            yield names_of(name, attempt.text)


def names_of(name: str, request: str) -> Sequence[str]:
    """The names of a room or thing: its own, and the words that asked for it where its own is a regex."""
    return (name,) if not request or name.casefold() in request.casefold() else (name, request)


def aliases(event: Event, names: Sequence[str], places: Sequence[str]) -> Aliases:
    """An event by each of the names of what it is about, and of the room where it happens."""
    if len(names) == len(places) == 1 and event.text == names[0] and event.place == places[0]:
        return (event,)
    return tuple(replace(event, text=name, place=place) for name in names for place in places)


def _moved(robot: SimulatedRobot, kind: str, request: str) -> Sequence[str]:
    """By which name the thing is recorded that would be picked up or put down."""
    if robot.rules.events != "as-happened":
        return ()
    if kind == "place" and robot.taken is not None:
        return (robot.taken.label,)
    here = robot.things[robot.room] if kind == "pick" else ()
    return [thing.label for thing in here if thing.is_meant_by(request, robot.rules.matching)][:1]


def _is_unclear(monitor: Monitor, event: Aliases) -> bool:
    """Whether an event cannot be judged, since it has options that are no text."""
    try:
        monitor.would_hold(*event)
    except Inconclusive:
        return True
    return False


def _would_hold(monitor: Monitor, event: Aliases) -> bool:
    try:
        return monitor.would_hold(*event)
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


def _results(rule: Rule, attempt: Aliases) -> Sequence[Aliases]:
    """An event as it may turn out, as far as a rule tells that apart."""
    found, answered = _results_of(rule)
    kind, options = attempt[0].kind, attempt[0].options
    if kind in found:
        return [tuple(replace(one, found=is_found) for one in attempt) for is_found in (True, False)]
    if kind in answered and options:
        return [tuple(replace(one, answer=option.text) for one in attempt) for option in options]
    return (attempt,)
