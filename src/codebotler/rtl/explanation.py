"""Why a formula does not hold on a trace, in one sentence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from codebotler.core.trace import Trace
from codebotler.core.words import brief, listed, times
from codebotler.rtl import formulas
from codebotler.rtl.semantics import (
    Inconclusive,
    bound,
    during_stays,
    first_stay,
    holds,
    matches,
    narrowed,
    scoped,
)
from codebotler.rtl.wording import deed, few, happening, is_any, room, verb


@dataclass(frozen=True)
class Explanation:
    """Why a formula fails.

    Args:
        clause: the smallest part of the formula, or its negation, that makes it fail; all of it where an
            option is no text.
        event: the position in the trace of the event that makes it fail; None for an absence.
        sentence: the reason for a reader, counting steps from 1.
    """

    clause: formulas.Formula
    event: int | None
    sentence: str


def explain(formula: formulas.Formula, trace: Trace) -> Explanation | None:
    """Why a formula fails on a trace; None if it holds.

    Args:
        formula: what was required.
        trace: what the robot did.
    """
    try:
        if holds(formula, trace):
            return None
    except Inconclusive as error:
        option = f"option {error.number + 1} of the question at step {error.event + 1}"
        problem = f"is not a string but {brief(error.option.text)}, so the requirement cannot be judged"
        return Explanation(formula, error.event, f"{option} {problem}")
    clause = _failing_part(formula, trace)
    deciding = _deciding(clause, trace, is_true=False)
    facts = [_fact(test, trace, is_true=is_true) for test, is_true in deciding]
    if len(facts) == 1:
        text = f"{facts[0].text}{facts[0].ending}{facts[0].detail}"
    else:
        both = "both" if len(facts) == 2 else "all"  # noqa: PLR2004 - that is what both means
        text = f"{', and it '.join(fact.text for fact in facts)}; these must not {both} be so"
    event = max((fact.event for fact in facts if fact.event is not None), default=None)
    return Explanation(clause, event, " ".join(f"the robot {text}".split()))


def _failing_part(formula: formulas.Formula, trace: Trace) -> formulas.Formula:
    match formula:
        case formulas.And(parts):
            return _failing_part(next(part for part in parts if not holds(part, trace)), trace)
        case formulas.Not(formulas.Not(part)):
            return _failing_part(part, trace)
        case formulas.Not(formulas.Or(parts)):
            return _failing_part(formulas.Not(next(part for part in parts if holds(part, trace))), trace)
    return formula


def _deciding(
    formula: formulas.Formula, trace: Trace, *, is_true: bool
) -> Iterator[tuple[formulas.Test, bool]]:
    """The tests that make a formula true or false, each with whether it is true itself."""
    mention = _as_mention(formula)
    if mention is not None and not is_true and not holds(mention, trace):
        yield mention, False
        return
    match formula:
        case formulas.Not(part):
            yield from _deciding(part, trace, is_true=not is_true)
        case formulas.And(parts) | formulas.Or(parts):
            needs_all = isinstance(formula, formulas.And) == is_true
            deciding = parts if needs_all else [next(one for one in parts if holds(one, trace) == is_true)]
            for part in deciding:
                yield from _deciding(part, trace, is_true=is_true)
        case _:
            yield formula, is_true


def _as_mention(formula: formulas.Formula) -> formulas.Test | None:
    """The one test that `ask(t, ".*") or ask(".*", t)` comes to."""
    match formula:
        case formulas.Or((one, other)) if isinstance(one, formulas.Presence) and isinstance(
            other, formulas.Presence
        ):
            a, b = one.element, other.element
            if a.options is None or b.options is None or (a.text, a.options) != (b.options, b.text):
                return None
            text = a.options if is_any(a.text) else a.text
            mention = replace(a, text=text, options=None, mention=True)
            if replace(one, element=b) == other and is_any(a.text) != is_any(a.options):
                return replace(one, element=mention)
    return None


_AtPlace = formulas.ActAtFirst | formulas.ActAtSome


class _Fact(NamedTuple):
    """Whether a test is true, in English; the words `the robot` stand before it."""

    event: int | None
    text: str
    ending: str = ""  # what was required instead, unless other facts follow
    detail: str = ""  # what came nearest


def _fact(test: formulas.Test, trace: Trace, *, is_true: bool) -> _Fact:
    match test:
        case formulas.Count(element, 0):
            return _fact(formulas.Exists(element, test.scopes), trace, is_true=not is_true)
        case formulas.AtLeast(element, 1):
            return _fact(formulas.Exists(element, test.scopes), trace, is_true=is_true)
        case formulas.Count() | formulas.AtLeast():
            return _number(test, trace, is_true=is_true)
    return _presence(test, trace) if is_true else _absence(test, trace)


def _presence(test: formulas.Presence, trace: Trace) -> _Fact:
    element, here = test.element, _positions(test, trace)
    at = next(at for at in here if matches(element, trace, at))
    done, did = f"{verb(element.kind).past} {happening(trace[at], element)}", deed(element, "past")
    place = f" in {room(test.arrival.text)}" if isinstance(test, _AtPlace) else ""
    last = " last," if isinstance(test, formulas.Last) else ""
    text = f"{did}{place}{last} at step {at + 1}{_where(test.scopes, trace)}"
    return _Fact(at, text, ", which it must not do", "" if done == did else f": it {done}")


def _absence(test: formulas.Presence, trace: Trace) -> _Fact:
    element, where = test.element, _where(test.scopes, trace)
    here = [*_positions(test, trace)]
    if isinstance(test, formulas.Exists):
        event, detail = _instead(element, trace, here)
        return _Fact(event, f"never {deed(element, 'past', negated=True)}{where}", detail=detail)
    if isinstance(test, formulas.Last):
        return _not_last(element, where, trace, here)
    span = scoped(test.scopes, trace)
    arrivals = [at for at in span if matches(test.arrival, trace, at)]
    if not arrivals:
        _, detail = _instead(test.arrival, trace, span)
        text = f"never {deed(test.arrival, 'past', negated=True)}{where}"
        return _Fact(None, text, f", where it was to {deed(element, 'base')}", detail)
    first = isinstance(test, formulas.ActAtFirst)
    there = "during that stay" if first and len(arrivals) > 1 else "there"
    event, detail = _instead(element, trace, here)
    if not detail:
        kinds = dict.fromkeys(trace[at].kind for at in here if trace[at].kind != "goto")
        only = listed([verb(kind).alone for kind in kinds])
        detail = f": it only {only}" if only else ": it did nothing there"
    visits = arrivals[:1] if first else arrivals
    rooms = dict.fromkeys(happening(trace[at], test.arrival) for at in visits)
    failed = f"did not {deed(element, 'base', negated=True)} {there}{where}"
    text = f"went to {listed(few([*rooms]))} at {_steps(visits)} but {failed}"
    return _Fact(arrivals[0] if event is None else event, text, detail=detail)


def _not_last(element: formulas.EventPattern, where: str, trace: Trace, here: Sequence[int]) -> _Fact:
    text = f"did not {deed(element, 'base', negated=True)} last{where}"
    if not here:
        return _Fact(None, text, detail=": it did nothing")
    (at,) = here
    kind, event = trace[at].kind, trace[at]
    wanted = element if kind == element.kind else formulas.EventPattern(kind, formulas.Regex(".*"))
    return _Fact(at, text, detail=f": it last {verb(kind).past} {happening(event, wanted)} (step {at + 1})")


def _number(test: formulas.Count | formulas.AtLeast, trace: Trace, *, is_true: bool) -> _Fact:
    where, number, exactly = _where(test.scopes, trace), test.number, isinstance(test, formulas.Count)
    span = scoped(test.scopes, trace)
    found = [at for at in span if _is_match(test.element, trace, at)]
    if found:
        text = f"{deed(test.element, 'past')} {times(len(found))} ({_steps(found)}){where}"
    else:
        text = f"never {deed(test.element, 'past', negated=True)}{where}"
    if is_true:
        limit = (
            f"must not do so exactly {times(number)}"
            if exactly
            else f"must do so fewer than {number:,} times"
        )
        return _Fact(found[-1] if found else None, text, f", but {limit}")
    if not found:
        _, detail = _instead(test.element, trace, span)
        return _Fact(None, text, f", but should have {'' if exactly else 'at least '}{times(number)}", detail)
    ending = f" instead of {'' if exactly else 'at least '}{times(number)}"
    return _Fact(found[number] if len(found) > number else None, text, ending)


def _positions(test: formulas.Presence, trace: Trace) -> Iterable[int]:
    """The positions of the events that a test looks at."""
    span = scoped(test.scopes, trace)
    match test:
        case formulas.Exists():
            return span
        case formulas.Last():
            return span[-1:]
        case formulas.ActAtSome():
            return during_stays(test, trace, span)
    return first_stay(test, trace, span) or ()


def _where(scopes: tuple[formulas.Scope, ...], trace: Trace) -> str:
    """Scopes in English, such as ` after going to the lobby (step 1)`."""
    span, parts = range(len(trace)), []
    for scope in scopes:
        at = bound(scope, trace, span)
        when = "before" if scope.is_before else "after"
        if at is None:
            done = f"{deed(scope.element, 'ing')} (which never happened)"
        else:
            done = f"{verb(scope.element.kind).ing} {happening(trace[at], scope.element)} (step {at + 1})"
        parts.append(f" {when} {done}")
        span = narrowed(scope, at, span)
    return " and".join(parts)


def _instead(element: formulas.EventPattern, trace: Trace, here: Sequence[int]) -> tuple[int | None, str]:
    """What the robot did instead of an element: the same elsewhere, or other things of this kind here."""
    done = [at for at in range(len(trace)) if _is_match(element, trace, at)]
    if done:
        return done[0], f": it did so only at {_steps(done)}"
    alike = [at for at in here if trace[at].kind == element.kind]
    if not alike:
        return None, "" if trace else ": it did nothing at all"
    only = f": it only {verb(element.kind).past}"
    if element.kind == "goto":
        rooms = dict.fromkeys(happening(trace[at], element) for at in alike)
        return None, f"{only} {listed(few([*rooms]))}"
    return alike[
        0
    ], f"{only} {listed(few([f'{happening(trace[at], element)} (step {at + 1})' for at in alike]))}"


def _is_match(element: formulas.EventPattern, trace: Trace, at: int) -> bool:
    try:
        return matches(element, trace, at)
    except Inconclusive:
        return False


def _steps(found: Sequence[int]) -> str:
    numbers = few([str(at + 1) for at in found])
    return f"step{'s' * (len(found) > 1)} {listed(numbers)}"
