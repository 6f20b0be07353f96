"""Why a formula does not hold on a trace, in one sentence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby
from typing import TYPE_CHECKING, assert_never

from codebotler.rtl.formula import ActAtFirst, ActAtSome, And, AtLeast, Count, Exists, Not, Or, Stay
from codebotler.rtl.semantics import CannotJudge, at_place, cut, first, first_stay, holds, matches
from codebotler.rtl.window import Window
from codebotler.rtl.wording import (
    did,
    happened,
    is_any,
    lacking,
    listed,
    missing,
    offered,
    pastimes,
    room,
    room_name,
    shortened,
    times,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from codebotler.rtl.formula import Element, Formula, Test
    from codebotler.rtl.wording import Deed
    from codebotler.trace import Trace

_MOST = 5
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
    except CannotJudge as error:
        reason = _unjudged(formula, trace, error)
    else:
        reason = _why_false(formula, trace)
    # A text that a robot says or a formula looks for may hold line breaks.
    return Explanation(reason.clause, reason.event, " ".join((reason.told + reason.detail).split()))


@dataclass(frozen=True)
class _Reason:
    """Why a formula fails.

    Args:
        clause: the smallest part of the formula, or its negation, that makes it fail.
        event: what makes it fail.
        told: what is or is not so.
        detail: what comes nearest to it, or what there is to see, from a colon on.
    """

    clause: Formula
    event: int | None
    told: str
    detail: str = ""


def _unjudged(formula: Formula, trace: Trace, error: CannotJudge) -> _Reason:
    option = f"option {error.number + 1} of the question at step {error.event + 1}"
    told = f"{option} is no text but {shortened(error.option.text)}, so what was required cannot be judged"
    return _Reason(_unjudged_part(formula, trace), error.event, told)


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
        except CannotJudge:
            return _unjudged_part(part, trace)
    return formula


def _why_false(formula: Formula, trace: Trace) -> _Reason:
    match formula:
        case And(parts):
            return _why_false(next(part for part in parts if not holds(part, trace)), trace)
        case Or(parts):
            return _why_none(formula, parts, trace)
        case Not(part):
            return _why_true(part, trace)
        case _:
            return _Absence(formula, (formula.element,), trace).explain()


def _why_none(formula: Or, parts: tuple[Formula, ...], trace: Trace) -> _Reason:
    if test := _one_test(parts):
        reason = _Absence(test, tuple(_test(part).element for part in parts), trace).explain()
        return replace(reason, clause=formula)
    reasons = [_why_false(part, trace) for part in _alternatives(parts)]
    likeliest = next((reason for reason in reasons if reason.event is not None), reasons[0])
    if len(reasons) == 2:  # noqa: PLR2004 - only two are short enough to be told both
        other = reasons[likeliest is reasons[0]]
        told = f"one of two things had to be so, but {other.told}, and {_again(likeliest.told)}"
    else:
        told = f"one of {len(reasons)} things had to be so, but none is; for one, {likeliest.told}"
    return _Reason(formula, likeliest.event, told, likeliest.detail)


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


class _Absence:
    """Why a test fails: what it asks for has not happened.

    Args:
        test: the test.
        deed: what it asks for, instead of its own element.
        trace: what the robot did.
    """

    def __init__(self, test: Test, deed: Deed, trace: Trace) -> None:
        self.test, self.deed, self.trace = test, deed, trace
        self.window = Window(test.cuts, trace)
        self.where = self.window.told()

    def explain(self) -> _Reason:
        match self.test:
            case Exists():
                return self.nowhere()
            case ActAtFirst(place):
                stay = first_stay(self.test.stay, self.trace, self.window.span)
                return self.not_there([*range(*stay)], place, self.test.stay) if stay else self.never_went()
            case ActAtSome(place):
                at = [*at_place(self.test.stay, self.trace, self.window.span)]
                arrived = first(self.test.stay.arrival, self.trace, self.window.span) is not None
                return self.not_there(at, place, self.test.stay) if arrived else self.never_went()
            case Count(_, number):
                return self.miscounted(number, "")
            case AtLeast(_, number):
                return self.miscounted(number, "at least ")
        assert_never(self.test)

    def nowhere(self) -> _Reason:
        if not self.trace:
            return self.because(
                f"the robot did nothing at all, so it never {did(self.deed, 'past', never=True)}"
            )
        event, detail = self.instead(range(*self.window.span))
        never = f"never {did(self.deed, 'past', never=True)}{self.where}"
        return self.because(self.robot() + never, event, detail)

    def never_went(self) -> _Reason:
        assert isinstance(self.test, ActAtFirst | ActAtSome)
        arrival = self.test.stay.arrival
        if not self.trace:
            return self.because(f"the robot did nothing at all, so it {self.never_arrived()}")
        _, detail = _Absence(Exists(arrival, self.test.cuts), (arrival,), self.trace).instead(
            range(*self.window.span)
        )
        never = f"{self.never_arrived()}{self.window.told_until()}, where it was to "
        never += did(self.deed, "base")
        return self.because(self.window.told_after() + self.robot() + never, detail=detail)

    def robot(self) -> str:
        """The subject, after what should have begun the part of the trace but never happened."""
        never = self.window.never_began()
        said_anyway = isinstance(self.test, ActAtFirst | ActAtSome) and never == self.never_arrived()
        needed = never and not self.window.told_after() and not said_anyway
        return f"the robot {never}; it " if needed else "the robot "

    def never_arrived(self) -> str:
        assert isinstance(self.test, ActAtFirst | ActAtSome)
        return f"never {did((self.test.stay.arrival,), 'past', never=True)}"

    def not_there(self, stay: list[int], place: str, moves: Stay) -> _Reason:
        span = self.window.span
        arrivals = [at for at in range(*span) if matches(moves.arrival, self.trace, at)]
        inside = set(stay)
        outside = [at for at in arrivals if at not in inside]
        if isinstance(self.test, ActAtFirst):
            there = "there" if len(outside) == 1 else "during that stay"
            went = f"went to {room_name(self.trace[arrivals[0]].text)} at step {arrivals[0] + 1}"
        else:
            there = "there"
            went = f"went to {room(place)} at {_steps(outside)}"
        event, detail = self.instead(stay)
        if not detail:
            only = pastimes(self.trace[at] for at in stay)
            detail = f": it only {only}" if only else ": it did nothing there"
        failed = f"did not {did(self.deed, 'base', never=True)} {there}"
        told = f"{self.window.told_after()}the robot {went} but {failed}{self.window.told_until()}"
        return self.because(told, arrivals[0] if event is None else event, detail)

    def miscounted(self, number: int, least: str) -> _Reason:
        found = [at for at in range(*self.window.span) if _seen(self.deed[0], self.trace, at)]
        if not found:
            never = self.nowhere()
            often = "" if number == 1 else f", but it should have {least}{times(number)}"
            return replace(never, told=never.told + often)
        if number == 0:
            return replace(_presence(Exists(self.deed[0], self.test.cuts), self.trace), clause=self.test)
        told = f"the robot {did(self.deed, 'past')} {times(len(found))} ({_steps(found)}){self.where}"
        event = found[number] if len(found) > number else None
        return self.because(f"{told} instead of {least}{times(number)}", event)

    def instead(self, here: Sequence[int]) -> tuple[int | None, str]:
        """The nearest thing that the robot did: elsewhere, or here in other words."""
        done = _where(self.deed, self.trace)
        if done:
            return done[0], f": it did so only {self.placed(done)}"
        if self.deed[0].kind == "goto":
            return None, self.went(here)
        near = max(
            (at for at in here if self.trace[at].kind == self.deed[0].kind), key=self.likeness, default=None
        )
        if near is None:
            return None, ""
        event = self.trace[near]
        return near, f": it {happened(event, 'past')} at step {near + 1}, {lacking(self.deed, event)}"

    def went(self, here: Sequence[int]) -> str:
        rooms = dict.fromkeys(self.trace[at].text for at in here if self.trace[at].kind == "goto")
        if not rooms:
            told = is_any(self.deed[0].text) or any(event.kind == "goto" for event in self.trace)
            return "" if told else ": it went nowhere"
        names = [room_name(name) for name in rooms]
        shown = names if len(names) <= _MOST else [*names[:_MOST], f"{len(names) - _MOST:,} more"]
        return f": it only went to {listed(shown)}"

    def placed(self, done: list[int]) -> str:
        at = done[0]
        steps = _steps(done)
        if at < self.window.span[0] and done[-1] < self.window.span[0]:
            return f"at {steps}, too early"
        if at >= self.window.span[1]:
            return f"at {steps}, too late"
        visit = next((i for i in range(at - 1, -1, -1) if self.trace[i].kind == "goto"), None)
        if len(done) > 1 or self.deed[0].kind == "goto":
            return f"at {steps}"
        if visit is None:
            return f"at {steps}, before going anywhere"
        return f"at {steps}, after {happened(self.trace[visit], 'ing')} at step {visit + 1}"

    def likeness(self, at: int) -> tuple[int, int]:
        event = self.trace[at]
        return -max(missing(element.text, event.text) for element in self.deed), -at

    def because(self, told: str, event: int | None = None, detail: str = "") -> _Reason:
        return _Reason(self.test, event, told, detail)


def _why_true(formula: Formula, trace: Trace) -> _Reason:  # noqa: PLR0911 - one for each kind of formula
    match formula:
        case And(parts):
            facts = [_fact(part, trace) for part in parts]
            both = "both" if len(facts) == 2 else "all"  # noqa: PLR2004 - that is what both means
            event = next((fact.event for fact in reversed(facts) if fact.event is not None), None)
            return _Reason(Not(formula), event, f"the robot {_joined(facts)}, which must not {both} be so")
        case Or(parts):
            return _why_true(next(part for part in parts if holds(part, trace)), trace)
        case Not(part):
            return _why_false(part, trace)
        case Count(element, 0):
            absence = _Absence(Exists(element, formula.cuts), (element,), trace).explain()
            return replace(absence, clause=Not(formula))
        case AtLeast(_, 0):
            sentence = "anything happens at least 0 times, so this can never be satisfied"
            return _Reason(Not(formula), None, sentence)
        case AtLeast(element, 1):
            return replace(_presence(Exists(element, formula.cuts), trace), clause=Not(formula))
        case _:
            return _presence(formula, trace)


def _presence(test: Test, trace: Trace) -> _Reason:
    window = Window(test.cuts, trace)
    fact = _fact(test, trace)
    assert fact.event is not None
    began = window.never_began()
    since = f" (it {began}, so every step counts)" if began else ""
    if isinstance(test, Count | AtLeast):
        limit = "not be exactly" if isinstance(test, Count) else "be less than"
        told = f"{fact.told}{fact.where}, but it must {limit} {times(test.number)}{since}"
        return _Reason(Not(test), fact.event, f"the robot {told}")
    told_anyway = any(at is None and one.name.startswith("Before") for one, at in window.made)
    duties = f", which it must not do{window.duties()}{'' if told_anyway else since}"
    visit = "" if isinstance(test, Exists) else fact.where
    event = trace[fact.event]
    spoken = test.element.kind in {"say", "ask"}
    if not spoken or (is_any(test.element.text) and test.element.options is None):
        return _Reason(Not(test), fact.event, f"the robot {fact.told}{visit}{duties}")
    told = f"{did((test.element,), 'past')} at step {fact.event + 1}{visit}{duties}"
    return _Reason(Not(test), fact.event, f"the robot {told}", f": it {offered(event)}")


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
    found = [at for at in range(*window.span) if _seen(test.element, trace, at)]
    if not found:
        return _Fact(None, f"never {did((test.element,), 'past', never=True)}", window.told())
    told = f"{did((test.element,), 'past')} {times(len(found))} ({_steps(found)})"
    return _Fact(found[min(max(test.number, 1), len(found)) - 1], told, window.told())


def _seen(element: Element, trace: Trace, at: int) -> bool:
    try:
        return matches(element, trace, at)
    except CannotJudge:
        return False


def _where(deed: Deed, trace: Trace) -> list[int]:
    return [at for at in range(len(trace)) if any(_seen(element, trace, at) for element in deed)]


def _steps(found: list[int]) -> str:
    numbers = [str(at + 1) for at in found]
    if len(numbers) > _MOST:
        numbers[_MOST:] = [f"{len(numbers) - _MOST:,} more"]
    return f"step {numbers[0]}" if len(numbers) == 1 else f"steps {listed(numbers)}"
