"""`Rule`: a requirement on every program; and the error of an event that a rule does not allow."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import VIOLATION, RobotError
from codebotler.core.phrases import phrase
from codebotler.core.skills.kinds import INSIDE
from codebotler.core.trace import Event
from codebotler.rtl import EventPattern, Formula
from codebotler.rtl.reasoning.alphabet import elements
from codebotler.rtl.semantics import is_match

Objection: TypeAlias = Literal["forbids", "cannot judge", "is broken by", "could not judge"]

# Why a rule cannot be judged, as the end of a sentence.
NON_TEXT_OPTION = "which offers an option that is no text"
UNKNOWN_ROOM = "since the robot does not say which room it is in"
AMBIGUOUS_GOAL = "since it may mean several rooms, and the robot does not say which"


@dataclass(frozen=True)
class Rule:
    """A requirement on every program, whatever the instruction is.

    Args:
        name: how messages name it.
        says: the rule for people and models, in a sentence.
        formula: the rule as a formula.
        when: `always`, of every prefix of a trace, or `finally`, when the mission ends.
        refuse: whether the program goes on without the refused action; else the mission ends.
        any_room: whether it may name rooms that a house lacks.
    """

    name: str
    says: str
    formula: Formula
    when: Literal["always", "finally"] = "always"
    refuse: bool = False
    any_room: bool = False

    @cached_property
    def elements(self) -> tuple[EventPattern, ...]:
        """All patterns of events in its formula."""
        return tuple(elements(self.formula))

    @cached_property
    def inside(self) -> tuple[EventPattern, ...]:
        """Its patterns of the rooms that the robot's pose enters."""
        return tuple(element for element in self.elements if element.kind == INSIDE)

    def depends_on_room(self, event: Event) -> bool:
        """Whether it compares the room in which such an event happens."""
        return any(one.place is not None for one in self.elements if one.kind == event.kind)

    def results(self, attempt: Event) -> Sequence[Event]:
        """Return an event with each result that it may have, if this rule compares results."""
        compared = [one for one in self.elements if one.kind == attempt.kind]
        if any(one.found is not None for one in compared):
            return [replace(attempt, found=True), replace(attempt, found=False)]
        if attempt.options and any(one.answer is not None for one in compared):
            return [replace(attempt, answer=option.text) for option in attempt.options]
        return (attempt,)

    def tells_apart(self, events: Iterable[Event]) -> bool:
        """Whether it matters to this rule which of some events happened."""
        events = tuple(events)
        return any(len({is_match(one, event, 0) for event in events}) > 1 for one in self.elements)


class RuleViolationError(RobotError):
    """A rule would be broken, or has been, or cannot be judged.

    Args:
        rule: the rule.
        event: the event that would break it, or has broken it; None at the end of a mission.
        objection: what the rule has to do with the event.
        why: why it cannot be judged, as the end of a sentence.
    """

    def __init__(
        self, rule: Rule, event: Event | None, objection: Objection = "forbids", why: str = ""
    ) -> None:
        what = "is not kept at the end" if event is None else f"{objection} {phrase(event, 'ing')}"
        because = f", {why}" if why else ""
        super().__init__(VIOLATION, f'the rule "{rule.name}" {what}{because}: {rule.says.rstrip(".")}')
        self.rule, self.event, self.objection, self.why = rule, event, objection, why

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.rule, self.event, self.objection, self.why), vars(self)

    @property
    def is_late(self) -> bool:
        """Whether the event has happened already."""
        return self.objection in {"is broken by", "could not judge"}

    @property
    def ends_run(self) -> bool:
        """Whether the program cannot go on, whatever it catches."""
        return self.is_late or self.why == UNKNOWN_ROOM or not self.rule.refuse
