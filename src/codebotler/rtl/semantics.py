"""Evaluate formulas on traces in linear time.

A scope is a range of positions. A test reads the events once, in order, and stops as soon as it is decided.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl import formulas


@dataclass(eq=False, repr=False)
class Inconclusive(Exception):  # noqa: N818 - a third verdict, not a mistake of the caller
    """Raised if it is unknown whether a formula holds, because an option of a question is not a string.

    Args:
        event: the question's position in the trace, counted from 0.
        number: the option's position in the question, counted from 0.
        option: the option.
    """

    event: int
    number: int
    option: Option

    def __str__(self) -> str:
        which = f"option {self.number + 1} of the question at step {self.event + 1}"
        return f"{which} is not a string: {self.option.text}"


def holds(formula: formulas.Formula, trace: Trace) -> bool:
    """Whether a formula holds on a trace. Raise Inconclusive if it depends on a non-string option."""
    if isinstance(formula, formulas.Not):
        return not holds(formula.part, trace)
    if isinstance(formula, formulas.And):
        return all(holds(part, trace) for part in formula.parts)
    if isinstance(formula, formulas.Or):
        return any(holds(part, trace) for part in formula.parts)
    return _test_holds(formula, trace)


def compared_fields(trace: Trace) -> tuple[object, ...]:
    """Return the fields of events that formulas can compare (texts, not times), for use as a cache key."""
    return tuple(
        (e.kind, e.text, e.options, e.answer, e.found, e.place, e.holding, e.to, e.more) for e in trace
    )


def _test_holds(test: formulas.Test, trace: Trace) -> bool:
    match test:
        case formulas.AtLeast(element, number):
            return at_least(element, number, trace, positions_in_scopes(test.scopes, trace)) == number
        case formulas.Count(element, number):
            return at_least(element, number + 1, trace, positions_in_scopes(test.scopes, trace)) == number
    return next(occurrences(test.element, trace, positions(test, trace)), None) is not None


def positions(test: formulas.PresenceTest, trace: Trace) -> Iterable[int]:
    """Return the positions in a trace where a test looks for an event; only the last one for `Last`."""
    span = positions_in_scopes(test.stay if isinstance(test, formulas.ActAtFirst) else test.scopes, trace)
    if isinstance(test, formulas.ActAtSome):
        return during_stays(test, trace, span)
    return span[-1:] if isinstance(test, formulas.Last) else span


def is_match(element: formulas.EventPattern, event: Event, at: int) -> bool:
    """Whether a pattern matches an event. Errors mention `at`, the event's position, counted from 0.

    Raises:
        Inconclusive: an option that is not a string precedes the first match.
    """
    if event.kind != element.kind:
        return False
    if element.place_regex is not None and element.place_regex.search(event.place) is None:
        return False
    if element.is_about_more and not _fits(element, event):
        return False
    if element.mention and any(element.text.matches(option.text) for option in event.options):
        return True
    if element.options is not None and not _offers(element, event, at):
        return False
    return element.text.matches(event.text)


def _fits(element: formulas.EventPattern, event: Event) -> bool:
    """Whether the result, answer, held object, addressee and further arguments match."""
    wanted = (element.answer, event.answer), (element.holding, event.holding or None), (element.to, event.to)
    if any(text is not None and (is_ is None or not text.matches(is_)) for text, is_ in wanted):
        return False
    if len(event.more) < len(element.more):
        return False
    if any(not text.matches(given) for text, given in zip(element.more, event.more, strict=False)):
        return False
    return element.found is None or event.found is element.found


def _offers(element: formulas.EventPattern, event: Event, at: int) -> bool:
    assert element.options is not None
    for number, option in enumerate(event.options):
        if not option.is_text:
            raise Inconclusive(at, number, option)
        if element.options.matches(option.text):
            return True
    return False


def occurrences(element: formulas.EventPattern, trace: Trace, span: Iterable[int]) -> Iterator[int]:
    """Yield the positions in `span`, a part of the trace, whose events match `element`."""
    kind = element.kind  # compared first, since most events have another kind
    for at in span:
        event = trace[at]
        if event.kind == kind and is_match(element, event, at):
            yield at


def at_least(element: formulas.EventPattern, number: int, trace: Trace, span: range) -> int:
    """Count the events in `span` that match `element`, but stop at `number`."""
    return sum(1 for _ in islice(occurrences(element, trace, span), min(number, len(span))))


def positions_in_scopes(scopes: tuple[formulas.Scope, ...], trace: Trace) -> range:
    """Return the positions in a trace, counted from 0, that are within all scopes."""
    span = range(len(trace))
    for scope in scopes:
        span = narrow(scope, bounding_event(scope, trace, span), span)
    return span


def bounding_event(scope: formulas.Scope, trace: Trace, span: range) -> int | None:
    """Return the position of the event at which a scope begins or ends, or None if `span` has none."""
    found = occurrences(scope.element, trace, span)
    return next(found, None) if scope.name.endswith("First") else max(found, default=None)


def narrow(scope: formulas.Scope, at: int | None, span: range) -> range:
    """Return the positions of `span`, a part of a trace, that are inside a scope.

    The scope begins or ends at the event with the position `at`, or `at` is None if there is no such event.
    """
    if at is None:
        return range(span.stop, span.stop) if scope.is_only else span
    return range(span.start, at) if scope.is_before else range(at + 1, span.stop)


def during_stays(test: formulas.ActAtSome, trace: Trace, span: range) -> Iterator[int]:
    """Yield the positions during all stays at a test's place.

    A stay excludes the move that ends it. The move that begins it counts only as part of an earlier stay.
    """
    is_there = False
    for at in span:
        is_there = is_there and not is_match(test.departure, trace[at], at)
        if is_there:
            yield at
        is_there = is_there or is_match(test.arrival, trace[at], at)
