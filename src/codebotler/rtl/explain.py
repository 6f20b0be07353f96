"""Why a formula does not hold on a trace, in one sentence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, assert_never

from codebotler.core.words import listed, times
from codebotler.rtl.absence import Absence, Reason, seen, steps_of
from codebotler.rtl.formula import ActAtFirst, ActAtSome, And, AtLeast, Count, Exists, Not, Or
from codebotler.rtl.phrases import is_any, shortened
from codebotler.rtl.semantics import Inconclusive, at_place, cut, first, holds, matches
from codebotler.rtl.window import Window
from codebotler.rtl.wording import did, happened, offered

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from codebotler.core.trace import Trace
    from codebotler.rtl.formula import Formula, Test

_ROBOT = "the robot "


@dataclass(frozen=True)
class Explanation:
    """Why a formula fails.

    Args:
        clause: the smallest part of the formula, or its negation, that makes it fail.
        event: the position in the trace of the event that makes it fail; None for an absence.
        sentence: the reason for a reader, counting steps from 1.
    """

    clause: Formula
    event: int | None
    sentence: str


def explain(formula: Formula, trace: Trace) -> Explanation | None:
    """Why a formula fails on a trace; None if it holds.

    Args:
        formula: what was required.
        trace: what the robot did.
    """
    try:
        if holds(formula, trace):
            return None
    except Inconclusive as error:
        reason = _unjudged(formula, trace, error)
    else:
        reason = _why_false(formula, trace)
    # A text that a robot says or a formula looks for may hold line breaks.
    return Explanation(reason.clause, reason.event, " ".join((reason.told + reason.detail).split()))


def _unjudged(formula: Formula, trace: Trace, error: Inconclusive) -> Reason:
    option = f"option {error.number + 1} of the question at step {error.event + 1}"
    told = f"{option} is no text but {shortened(error.option.text)}, so what was required cannot be judged"
    return Reason(_unjudged_part(formula, trace), error.event, told)


def _unjudged_part(formula: Formula, trace: Trace) -> Formula:
    parts = (
        formula.parts
        if isinstance(formula, And | Or)
        else (formula.part,)
        if isinstance(formula, Not)
        else ()
    )
    for part in parts:
        try:
            holds(part, trace)
        except Inconclusive:
            return _unjudged_part(part, trace)
    return formula


def _why_false(formula: Formula, trace: Trace) -> Reason:
    match formula:
        case And(parts):
            return _why_false(next(part for part in parts if not holds(part, trace)), trace)
        case Or(parts):
            return _why_none(formula, parts, trace)
        case Not(part):
            return _why_true(part, trace)
        case Count(element, 0):
            return replace(_presence(Exists(element, formula.cuts), trace), clause=formula)
        case _:
            return Absence(formula, (formula.element,), trace).explain()


def _why_none(formula: Or, parts: tuple[Formula, ...], trace: Trace) -> Reason:
    if test := _one_test(parts):
        reason = Absence(test, tuple(_test(part).element for part in parts), trace).explain()
        return replace(reason, clause=formula)
    reasons = [_why_false(part, trace) for part in _alternatives(parts)]
    likeliest = next((reason for reason in reasons if reason.event is not None), reasons[0])
    if len(reasons) == 2:  # noqa: PLR2004 - only two are short enough to be told both
        other = reasons[likeliest is reasons[0]]
        told = f"one of two things had to be so, but {other.told}, and {_again(likeliest.told)}"
    else:
        told = f"one of {len(reasons)} things had to be so, but none is; for one, {likeliest.told}"
    return Reason(formula, likeliest.event, told, likeliest.detail)


def _alternatives(parts: tuple[Formula, ...]) -> Iterator[Formula]:
    """The parts of an `or`, and those of an `or` among them in its stead."""
    for part in parts:
        if isinstance(part, Or) and not _one_test(part.parts):
            yield from _alternatives(part.parts)
        else:
            yield part


def _again(told: str) -> str:
    """What is told after something else of the robot."""
    return f"it {told.removeprefix(_ROBOT)}" if told.startswith(_ROBOT) else told


def _one_test(parts: Sequence[Formula]) -> Test | None:
    """The test of which the parts are variants, for a text that may stand in a question or in its options."""
    match parts:
        case (Exists() | ActAtFirst() | ActAtSome() as one, Exists() | ActAtFirst() | ActAtSome() as other):
            a, b = one.element, other.element
            if a.options is None or b.options is None:
                return None
            crossed = (a.text, a.options) == (b.options, b.text) and is_any(a.text) != is_any(a.options)
            return one if crossed and _elsewise(one) == _elsewise(other) else None
    return None


def _elsewise(test: Exists | ActAtFirst | ActAtSome) -> tuple[object, ...]:
    return type(test), test.cuts, None if isinstance(test, Exists) else test.place


def _test(formula: Formula) -> Test:
    assert not isinstance(formula, And | Or | Not)
    return formula


def _why_true(formula: Formula, trace: Trace) -> Reason:  # noqa: PLR0911 - one for each kind of formula
    match formula:
        case And(parts):
            facts = [_fact(part, trace) for part in parts]
            both = "both" if len(facts) == 2 else "all"  # noqa: PLR2004 - that is what both means
            event = next((fact.event for fact in reversed(facts) if fact.event is not None), None)
            return Reason(Not(formula), event, f"the robot {_joined(facts)}, which must not {both} be so")
        case Or(parts):
            return _why_true(next(part for part in parts if holds(part, trace)), trace)
        case Not(part):
            return _why_false(part, trace)
        case Count(element, 0):
            absence = Absence(Exists(element, formula.cuts), (element,), trace).explain()
            return replace(absence, clause=Not(formula))
        case AtLeast(_, 0):
            sentence = "anything happens at least 0 times, so this can never be satisfied"
            return Reason(Not(formula), None, sentence)
        case AtLeast(element, 1):
            return replace(_presence(Exists(element, formula.cuts), trace), clause=Not(formula))
        case _:
            return _presence(formula, trace)


def _presence(test: Test, trace: Trace) -> Reason:
    window = Window(test.cuts, trace)
    fact = _fact(test, trace)
    assert fact.event is not None
    began = window.never_began()
    since = f" (it {began}, so every step counts)" if began else ""
    if isinstance(test, Count | AtLeast):
        limit = "not be exactly" if isinstance(test, Count) else "be less than"
        told = f"{fact.told}{fact.where}, but it must {limit} {times(test.number)}{since}"
        return Reason(Not(test), fact.event, f"the robot {told}")
    told_anyway = any(at is None and one.name.startswith("Before") for one, at in window.made)
    duties = f", which it must not do{window.duties()}{'' if told_anyway else since}"
    visit = "" if isinstance(test, Exists) else fact.where
    event = trace[fact.event]
    spoken = test.element.kind in {"say", "ask"}
    if not spoken or (is_any(test.element.text) and test.element.options is None):
        return Reason(Not(test), fact.event, f"the robot {fact.told}{visit}{duties}")
    told = f"{did((test.element,), 'past')} at step {fact.event + 1}{visit}{duties}"
    return Reason(Not(test), fact.event, f"the robot {told}", f": it {offered(event)}")


@dataclass(frozen=True)
class _Fact:
    """Something true; `the robot` stands before it.

    Args:
        event: what makes it so.
        told: what is so.
        where: in which part of the trace.
    """

    event: int | None
    told: str
    where: str = ""


def _joined(facts: list[_Fact]) -> str:
    """All facts, naming a part of the trace once for neighbours that share it."""
    groups = groupby(facts, key=lambda fact: fact.where)
    return listed([listed([fact.told for fact in group]) + where for where, group in groups], "and also")


def _fact(formula: Formula, trace: Trace) -> _Fact:
    match formula:
        case And(parts):
            facts = [_fact(part, trace) for part in parts]
            return _Fact(facts[-1].event, _joined(facts))
        case Or(parts):
            return _fact(next(part for part in parts if holds(part, trace)), trace)
        case Not(part):
            return _fact_of_false(part, trace)
        case Exists(element):
            window = Window(formula.cuts, trace)
            at = first(element, trace, window.span)
            assert at is not None
            return _Fact(at, f"{happened(trace[at], 'past')} at step {at + 1}", window.told())
        case ActAtFirst() | ActAtSome():
            return _deed_at_place(formula, trace)
        case Count() | AtLeast():
            return _counted(formula, trace)
    assert_never(formula)


def _fact_of_false(formula: Formula, trace: Trace) -> _Fact:  # noqa: PLR0911 - one for each kind of formula
    """What is so because a formula is not."""
    match formula:
        case Not(part):
            return _fact(part, trace)
        case And(parts):
            return _fact_of_false(next(part for part in parts if not holds(part, trace)), trace)
        case Or(parts) if not _one_test(parts):
            return _fact(And(tuple(map(Not, parts))), trace)
        case Count(element, 0):
            return _fact(Exists(element, formula.cuts), trace)
        case Count() | AtLeast():
            return _counted(formula, trace)
        case ActAtFirst() | ActAtSome() if (
            first(formula.stay.arrival, trace, cut(formula.cuts, trace)) is None
        ):
            return _fact_of_false(Exists(formula.stay.arrival, formula.cuts), trace)
    absence = _why_false(formula, trace).told
    told = absence.removeprefix(_ROBOT)
    return _Fact(None, told if told != absence else f"acted so that {told}")


def _deed_at_place(test: ActAtFirst | ActAtSome, trace: Trace) -> _Fact:
    start, stop = Window(test.cuts, trace).span
    there = at_place(test.stay, trace, (start, stop))
    at = next(at for at in there if matches(test.element, trace, at))
    visit = max(i for i in range(start, at) if matches(test.stay.arrival, trace, i))
    where = f" after {happened(trace[visit], 'ing')} at step {visit + 1}"
    return _Fact(at, f"{happened(trace[at], 'past')} at step {at + 1}", where)


def _counted(test: Count | AtLeast, trace: Trace) -> _Fact:
    window = Window(test.cuts, trace)
    found = [at for at in range(*window.span) if seen(test.element, trace, at)]
    if not found:
        return _Fact(None, f"never {did((test.element,), 'past', never=True)}", window.told())
    told = f"{did((test.element,), 'past')} {times(len(found))} ({steps_of(found)})"
    return _Fact(found[min(max(test.number, 1), len(found)) - 1], told, window.told())
