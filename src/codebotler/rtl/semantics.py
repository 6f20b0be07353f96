"""Whether a formula holds on a trace, in time linear in the trace.

A cut is a pair of positions in the trace, never a copy. Every test and every cut looks at the events from the
first to the last and at each once, and stops at the event that settles it.
"""

from __future__ import annotations

from typing import TypeAlias, assert_never

from codebotler.rtl.formula import ActAtFirst, ActAtSome, And, AtLeast, Count, Exists, Not, Or

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator

    from codebotler.core.trace import Event, Option, Trace
    from codebotler.rtl.formula import Cuts, EventPattern, Formula, Scope, Stay, Test

Span: TypeAlias = tuple[int, int]
"""The events from the first position on and before the second."""


class Inconclusive(Exception):  # noqa: N818 - not a mistake of the caller but a third verdict
    """A question was to be judged, but one of its options is no text.

    Args:
        event: the question's position in the trace.
        number: the option's position in the question.
        option: the option.
    """

    def __init__(self, event: int, number: int, option: Option) -> None:
        super().__init__(f"option {number + 1} of the question at step {event + 1} is no text: {option.text}")
        self.event = event
        self.number = number
        self.option = option

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.event, self.number, self.option), vars(self)


def holds(formula: Formula, trace: Trace) -> bool:
    """Whether a formula is true of a trace.

    Args:
        formula: what to test.
        trace: what the robot did.

    Raises:
        Inconclusive: an option that is no text had to be compared.
    """
    match formula:
        case And(parts):
            return all(holds(part, trace) for part in parts)
        case Or(parts):
            return any(holds(part, trace) for part in parts)
        case Not(part):
            return not holds(part, trace)
        case _:
            return test_holds(formula, trace, cut(formula.cuts, trace))


def test_holds(test: Test, trace: Trace, span: Span) -> bool:
    """Whether a test is true of a part of a trace.

    Args:
        test: what to test; its cuts are not applied.
        trace: what the robot did.
        span: the part.

    Raises:
        Inconclusive: an option that is no text had to be compared.
    """
    match test:
        case Exists(element):
            return first(element, trace, span) is not None
        case ActAtFirst(_, element):
            stay = first_stay(test.stay, trace, span)
            return stay is not None and first(element, trace, stay) is not None
        case ActAtSome(_, element):
            return any(matches(element, trace, at) for at in at_place(test.stay, trace, span))
        case AtLeast(element, number):
            return at_least(element, number, trace, span) == number
        case Count(element, number):
            return at_least(element, number + 1, trace, span) == number
    assert_never(test)


test_holds.__test__ = False  # type: ignore[attr-defined]  # lest pytest takes it for a test


def matches(element: EventPattern, trace: Trace, at: int) -> bool:
    """Whether an element matches an event.

    Args:
        element: what the event may be.
        trace: what the robot did.
        at: the event's position.

    Raises:
        Inconclusive: both are questions, and an option that is no text comes before the first that
            matches; whether the question's text matches plays no part.
    """
    event = trace[at]
    if event.kind != element.kind or not element.happens_at(event.place):
        return False
    if element.answer is not None and (event.answer is None or not element.answer.matches(event.answer)):
        return False
    if element.mention and any(element.text.matches(option.text) for option in event.options):
        return True
    if element.options is not None and not _offers(element, event, at):
        return False
    return element.text.matches(event.text)


def _offers(element: EventPattern, event: Event, at: int) -> bool:
    assert element.options is not None
    for number, option in enumerate(event.options):
        if not option.is_text:
            raise Inconclusive(at, number, option)
        if element.options.matches(option.text):
            return True
    return False


def first(element: EventPattern, trace: Trace, span: Span) -> int | None:
    """The position of the first event that matches.

    Args:
        element: what the event may be.
        trace: what the robot did.
        span: where to look.

    Raises:
        Inconclusive: an option that is no text had to be compared.
    """
    return next((at for at in range(*span) if matches(element, trace, at)), None)


def last(element: EventPattern, trace: Trace, span: Span) -> int | None:
    """The position of the last event that matches; all are compared, from the first on.

    Args:
        element: what the event may be.
        trace: what the robot did.
        span: where to look.

    Raises:
        Inconclusive: an option that is no text had to be compared.
    """
    found = None
    for at in range(*span):
        if matches(element, trace, at):
            found = at
    return found


def at_least(element: EventPattern, number: int, trace: Trace, span: Span) -> int:
    """How many events match, counted no further than a number.

    Args:
        element: what the events may be.
        number: where to stop.
        trace: what the robot did.
        span: where to look.

    Raises:
        Inconclusive: an option that is no text had to be compared.
    """
    found = 0
    for at in range(*span):
        if found == number:
            break
        found += matches(element, trace, at)
    return found


def cut(cuts: Cuts, trace: Trace) -> Span:
    """The part of a trace that is left after cuts.

    Args:
        cuts: applied in order, each to what the one before has left.
        trace: what the robot did.

    Raises:
        Inconclusive: an option that is no text had to be compared.
    """
    span = (0, len(trace))
    for one in cuts:
        span = cut_at(one, find(one, trace, span), span)
    return span


def find(one: Scope, trace: Trace, span: Span) -> int | None:
    """The position at which a cut is made.

    Args:
        one: the cut.
        trace: what the robot did.
        span: the part to be cut.

    Raises:
        Inconclusive: an option that is no text had to be compared.
    """
    search = first if one.name.endswith("First") else last
    return search(one.element, trace, span)


def cut_at(one: Scope, at: int | None, span: Span) -> Span:
    """What a cut leaves of a part of a trace: all of it where nothing was found.

    Args:
        one: the cut.
        at: where it is made.
        span: the part to be cut.
    """
    if at is None:
        return span
    return (span[0], at) if one.name.startswith("Before") else (at + 1, span[1])


def first_stay(stay: Stay, trace: Trace, span: Span) -> Span | None:
    """What happens between the first arrival at a place and the next departure.

    Args:
        stay: the place.
        trace: what the robot did.
        span: where to look.
    """
    arrival = first(stay.arrival, trace, span)
    if arrival is None:
        return None
    after = (arrival + 1, span[1])
    departure = first(stay.departure, trace, after)
    return after if departure is None else (arrival + 1, departure)


def at_place(stay: Stay, trace: Trace, span: Span) -> Iterator[int]:
    """The positions of the events that happen at a place.

    A move that ends a stay is not in it, and a move that begins one only where it lies in an earlier stay.

    Args:
        stay: the place.
        trace: what the robot did.
        span: where to look.
    """
    there = False
    for at in range(*span):
        there = there and not matches(stay.departure, trace, at)
        if there:
            yield at
        there = there or matches(stay.arrival, trace, at)
