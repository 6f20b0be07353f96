"""Explain in one sentence why a formula fails on a trace."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from codebotler.core.skills.kinds import GOTO
from codebotler.core.text.phrases import verb
from codebotler.core.text.words import brief, elide_list, listed, times
from codebotler.core.trace import Trace
from codebotler.rtl import formulas
from codebotler.rtl.semantics import (
    Inconclusive,
    bounding_event,
    holds,
    is_match,
    narrow,
    positions,
    positions_in_scopes,
)
from codebotler.rtl.wording import describe_action, describe_event, room, room_name


@dataclass(frozen=True)
class Explanation:
    """The reason why a formula fails on a trace, and the event to blame.

    Args:
        event: the position, from 0, of the event that makes it fail; None if an event is missing.
        sentence: the reason in words, with steps counted from 1.
    """

    event: int | None
    sentence: str


def explain(formula: formulas.Formula, trace: Trace) -> Explanation | None:
    """Explain why a formula fails on a trace, or return None if it holds."""
    try:
        if holds(formula, trace):
            return None
    except Inconclusive as error:
        option = f"option {error.number + 1} of the question at step {error.event + 1}"
        problem = f"is not a string but {brief(error.option.text)}, so the requirement cannot be judged"
        return Explanation(error.event, f"{option} {problem}")
    deciding = _deciding_tests(formula, trace, is_true=False)
    facts = [_fact(test, trace, is_true=is_true) for test, is_true in deciding]
    event = max((fact.event for fact in facts if fact.event is not None), default=None)
    text = _join_facts([*{fact.text: fact for fact in facts}.values()])
    return Explanation(event, " ".join(f"the robot {text}".split()))


def _join_facts(facts: Sequence[_Fact]) -> str:
    if len(facts) == 1:
        return f"{facts[0].text}{facts[0].ending}{facts[0].detail}"
    done = [f"{one.text}{one.detail and f' ({one.detail[2:]})'}" for one in facts if not one.is_missing]
    did, never = (", and it ".join(texts) for texts in (done, [one.text for one in facts if one.is_missing]))
    if did and never:
        return f"{did}, although it {never}"
    return f"{did}; it must not do all of these" if did else f"{never}; it had to do at least one of these"


def _deciding_tests(
    formula: formulas.Formula, trace: Trace, *, is_true: bool
) -> Iterator[tuple[formulas.Test, bool]]:
    """Yield the tests that decide a formula, each with its truth value."""
    mention = _as_mention(formula)
    if mention is not None and not is_true:
        yield mention, False
        return
    match formula:
        case formulas.Not(part):
            yield from _deciding_tests(part, trace, is_true=not is_true)
        case formulas.And(parts) | formulas.Or(parts):
            needs_all = isinstance(formula, formulas.And) == is_true
            deciding = parts if needs_all else [next(one for one in parts if holds(one, trace) == is_true)]
            for part in deciding:
                yield from _deciding_tests(part, trace, is_true=is_true)
        case _:
            yield formula, is_true


def _as_mention(formula: formulas.Formula) -> formulas.Test | None:
    """Return the test with `mention` that is equivalent to `ask(t, ".*") or ask(".*", t)`."""
    match formula:
        case formulas.Or((formulas.Exists() | formulas.ActAtFirst() | formulas.ActAtSome() as one, other)):
            element, anything = one.element, formulas.Regex(".*")
            text = element.options if element.text == anything else element.text
            if text is not None:
                pairs = ((text, anything), (anything, text))
                asks = {replace(one, element=replace(element, text=t, options=o)) for t, o in pairs}
                if asks == {one, other}:
                    return replace(one, element=replace(element, text=text, options=None, mention=True))
    return None


_MAX_QUOTED = 3  # events shown in place of a missing one
_AtPlace = formulas.ActAtFirst | formulas.ActAtSome


class _Fact(NamedTuple):
    """The result of a test in English, as a predicate of `the robot`."""

    event: int | None
    text: str
    ending: str = ""  # the requirement; omitted if other facts follow
    detail: str = ""  # the closest event
    is_missing: bool = False  # whether the robot failed to do something


def _fact(test: formulas.Test, trace: Trace, *, is_true: bool) -> _Fact:
    match test:
        case formulas.Count(element, 0):
            return _fact(formulas.Exists(element, test.scopes), trace, is_true=not is_true)
        case formulas.AtLeast(element, 1):
            return _fact(formulas.Exists(element, test.scopes), trace, is_true=is_true)
        case formulas.Count() | formulas.AtLeast():
            return _number(test, trace, is_true=is_true)
    return _presence(test, trace) if is_true else _absence(test, trace)._replace(is_missing=True)


def _presence(test: formulas.PresenceTest, trace: Trace) -> _Fact:
    at = next(at for at in positions(test, trace) if is_match(test.element, trace[at], at))
    stay = f" in {room(test.arrival.text)}" if isinstance(test, _AtPlace) else ""
    step = f"{stay}{' last,' * isinstance(test, formulas.Last)} at step {at + 1}"
    where = _where(test.scopes, trace, is_true=True)
    text = describe_action(test.element, "past", when=step, where=where)
    element = replace(test.element, place=None)  # so that the room is not repeated
    done = describe_event(trace[at], element)
    detail = "" if done == describe_action(element, "past") else f": it {done}"
    return _Fact(at, text, ", which it must not do", detail)


def _absence(test: formulas.PresenceTest, trace: Trace) -> _Fact:
    element, where = test.element, _where(test.scopes, trace, is_true=False)
    here = [*positions(test, trace)]
    if isinstance(test, formulas.Exists):
        event, detail = _describe_instead(element, trace, here)
        text = f"never {describe_action(element, 'past', negated=True, where=where)}"
        return _Fact(event, text, detail=detail)
    if isinstance(test, formulas.Last):
        text = f"did not {describe_action(element, 'base', negated=True, when=' last', where=where)}"
        last = [f"{describe_event(trace[at], element)} (step {at + 1})" for at in here]
        return _Fact(next(iter(here), None), text, detail=f": it last {last[0] if last else 'did nothing'}")
    span = positions_in_scopes(test.scopes, trace)
    arrivals = [at for at in span if is_match(test.arrival, trace[at], at)]
    if not arrivals:
        _, detail = _describe_instead(test.arrival, trace, span)
        never = f"never {describe_action(test.arrival, 'past', negated=True)}"
        ending = f", where it was to {describe_action(element, 'base')}{where and ','}{where}"
        return _Fact(None, never, ending, detail)
    first = isinstance(test, formulas.ActAtFirst)
    there = "during that stay" if first and len(arrivals) > 1 else "there"
    event, detail = _describe_instead(element, trace, here)
    if not detail:
        kinds = dict.fromkeys(trace[at].kind for at in here if trace[at].kind != GOTO)
        only = listed([verb(kind).alone for kind in kinds])
        detail = f": it only {only}" if only else ": it did nothing there"
    visits = arrivals[:1] if first else arrivals
    rooms = dict.fromkeys(room_name(trace[at].text) for at in visits)
    failed = f"did not {describe_action(element, 'base', negated=True, when=f' {there}', where=where)}"
    text = f"went to {listed(elide_list([*rooms]))} at {_steps(visits)} but {failed}"
    return _Fact(arrivals[0] if event is None else event, text, detail=detail)


def _number(test: formulas.Count | formulas.AtLeast, trace: Trace, *, is_true: bool) -> _Fact:
    where, number = _where(test.scopes, trace, is_true=is_true), test.number
    exactly = isinstance(test, formulas.Count)
    span = positions_in_scopes(test.scopes, trace)
    found = [at for at in span if _is_conclusive_match(test.element, trace, at)]
    when = f" {times(len(found))} ({_steps(found)})" if found else ""
    text = describe_action(test.element, "past", negated=not found, when=when, where=where)
    text = text if found else f"never {text}"
    if is_true:
        limit = f"not do so exactly {times(number)}" if exactly else f"do so {times(number - 1)} at most"
        return _Fact(found[-1] if found else None, text, f", but {'must' if exactly else 'may'} {limit}")
    wanted = f"{'' if exactly else 'at least '}{times(number)}"
    ending = f" instead of {wanted}" if found else f", but should have {wanted}"
    detail = "" if found else _describe_instead(test.element, trace, span)[1]
    return _Fact(found[number] if len(found) > number else None, text, ending, detail, is_missing=True)


def _where(scopes: tuple[formulas.Scope, ...], trace: Trace, *, is_true: bool) -> str:
    """Describe the scopes, such as ` after going to the lobby (step 1)`.

    For a missing event, include bounds that never happened.
    """
    span, ends = range(len(trace)), {"after": "", "before": ""}
    for scope in scopes:
        at = bounding_event(scope, trace, span)
        when = "before" if scope.is_before else "after"
        if at is not None:
            ends[when] = f"{describe_event(trace[at], scope.element, 'ing')} (step {at + 1})"
        elif not is_true and (scope.is_only or not scope.is_before):
            ends[when] = f"{describe_action(scope.element, 'ing')} (which never happened)"
        span = narrow(scope, at, span)
    if all(ends.values()):
        return f" between {ends['after']} and {ends['before']}"
    return "".join(f" {when} {end}" for when, end in ends.items() if end)


def _describe_instead(
    element: formulas.EventPattern, trace: Trace, here: Sequence[int]
) -> tuple[int | None, str]:
    """Describe a matching event outside the scope, or other events of this kind inside it."""
    done = [at for at in range(len(trace)) if _is_conclusive_match(element, trace, at)]
    if done:
        return done[0], f": it did so only at {_steps(done)}"
    alike = [at for at in here if trace[at].kind == element.kind]
    if not alike:
        return None, "" if trace else ": it did nothing at all"
    if element.kind == GOTO:
        rooms = dict.fromkeys(room_name(trace[at].text) for at in alike)
        return None, f": it only went to {listed(elide_list([*rooms]))}"
    past = verb(element.kind).past
    objects = [describe_event(trace[at], element).removeprefix(past) for at in alike]
    shown = [f"{each} (step {at + 1})".strip() for at, each in zip(alike, objects, strict=True)]
    return alike[0], f": it only {past} {listed(elide_list(shown, _MAX_QUOTED))}"


def _is_conclusive_match(element: formulas.EventPattern, trace: Trace, at: int) -> bool:
    try:
        return is_match(element, trace[at], at)
    except Inconclusive:
        return False


def _steps(found: Sequence[int]) -> str:
    numbers = elide_list([str(at + 1) for at in found])
    return f"step{'s' * (len(found) > 1)} {listed(numbers)}"
