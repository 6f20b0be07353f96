"""`Rule`, a requirement that every program must meet, and the error raised when a rule is violated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import VIOLATION, RobotError
from codebotler.core.skills.kinds import GOTO, INSIDE
from codebotler.core.text.phrases import phrase
from codebotler.core.trace import Event
from codebotler.rtl import EventPattern, Formula, Regex
from codebotler.rtl.reasoning.alphabet import elements

Objection: TypeAlias = Literal["forbids", "cannot judge", "is broken by"]
WhenJudged: TypeAlias = Literal["always", "leaving", "finally"]

# Reasons why a rule cannot be judged, each the end of a sentence.
NON_TEXT_OPTION = "which offers an option that is not text"
UNKNOWN_ROOM = "since the robot does not say which room it is in"


@dataclass(frozen=True)
class Rule:
    """A requirement that every program must meet, whatever its instruction.

    Args:
        name: the rule's name in messages.
        says: the rule as a sentence for people and models.
        formula: the rule as a formula.
        when: `always` if the formula must hold after each event, `finally` if only at the end of the mission,
            `leaving` if at the end and each time the robot is about to leave a room.
        refuse: whether to skip a forbidden action and let the program continue, rather than end the mission.
        any_room: whether the rule may name rooms that the house does not have.
    """

    name: str
    says: str
    formula: Formula
    when: WhenJudged = "always"
    refuse: bool = False
    any_room: bool = False

    @cached_property
    def elements(self) -> tuple[EventPattern, ...]:
        """All event patterns in the formula."""
        return tuple(elements(self.formula))

    @cached_property
    def inside(self) -> tuple[EventPattern, ...]:
        """The event patterns of kind `inside`, which match when the robot's pose enters a room."""
        return tuple(element for element in self.elements if element.kind == INSIDE)

    @property
    def names_destination(self) -> bool:
        """Whether the rule mentions drives to particular rooms, such as the kitchen."""
        return any(one.kind == GOTO and one.text != Regex(".*") for one in self.elements)

    def depends_on_room(self, event: Event) -> bool:
        """Return whether the rule depends on the room in which an event of this kind happens."""
        return any(one.place is not None for one in self.elements if one.kind == event.kind)

    def results(self, attempt: Event) -> Sequence[Event]:
        """Return one copy of the event per possible result, or just the event if the rule ignores results."""
        compared = [one for one in self.elements if one.kind == attempt.kind]
        if any(one.found is not None for one in compared):
            return [replace(attempt, found=True), replace(attempt, found=False)]
        if attempt.options and any(one.answer is not None for one in compared):
            return [replace(attempt, answer=option.text) for option in attempt.options]
        return (attempt,)


class RuleViolationError(RobotError):
    """Raised if a rule would be broken, has been broken or cannot be judged.

    Args:
        rule: the rule in question.
        event: the event that breaks the rule, or None if the rule is broken at the end of a mission.
        objection: the verb in the message: the rule `forbids`, `cannot judge` or `is broken by` the event.
        why: why the rule cannot be judged: a clause for the message, such as `since ...`.
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
        """Whether the event has already happened, so that the guard could not prevent it."""
        return self.objection == "is broken by"

    @property
    def ends_run(self) -> bool:
        """Whether the run ends, even if the program catches this error."""
        return self.is_late or self.why == UNKNOWN_ROOM or not self.rule.refuse
