"""Why a formula does not hold on a trace, in one sentence."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, assert_never

from codebotler.rtl.formula import ActAtFirst, ActAtSome, And, AtLeast, Count, Exists, Not, Or, Stay
from codebotler.rtl.semantics import CannotJudge, at_place, first, first_stay, holds, matches
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
    times,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from codebotler.rtl.formula import Element, Formula, Test
    from codebotler.rtl.wording import Deed
    from codebotler.trace import Trace

_MOST = 5


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
        return _unjudged(formula, trace, error)
    return _why_false(formula, trace)


def _unjudged(formula: Formula, trace: Trace, error: CannotJudge) -> Explanation:
    option = f"option {error.number + 1} of the question at step {error.event + 1}"
    sentence = f"{option} is no text but {error.option.text}, so what was required cannot be judged"
    return Explanation(_unjudged_part(formula, trace), error.event, sentence)


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


def _why_false(formula: Formula, trace: Trace) -> Explanation:
    match formula:
        case And(parts):
            return _why_false(next(part for part in parts if not holds(part, trace)), trace)
        case Or(parts):
            return _why_none(formula, parts, trace)
        case Not(part):
            return _why_true(part, trace)
        case _:
            return _Absence(formula, (formula.element,), trace).explain()


def _why_none(formula: Or, parts: tuple[Formula, ...], trace: Trace) -> Explanation:
    if test := _one_test(parts):
        reason = _Absence(test, tuple(_test(part).element for part in parts), trace).explain()
        return Explanation(formula, reason.event, reason.sentence)
    reasons = [_why_false(part, trace) for part in parts]
    likeliest = next((reason for reason in reasons if reason.event is not None), reasons[0])
    if len(reasons) == 2:  # noqa: PLR2004 - only two are short enough to be told both
        sentence = f"one of two things had to be so, but {reasons[0].sentence}, and {reasons[1].sentence}"
    else:
        sentence = f"one of {len(reasons)} things had to be so, but none is; for one, {likeliest.sentence}"
    return Explanation(formula, likeliest.event, sentence)


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

    def explain(self) -> Explanation:
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

    def nowhere(self) -> Explanation:
        if not self.trace:
            return self.because(
                f"the robot did nothing at all, so it never {did(self.deed, 'past', never=True)}"
            )
        event, detail = self.instead(range(*self.window.span))
        never = f"never {did(self.deed, 'past', never=True)}{self.where}{detail}"
        return self.because(self.robot() + never, event)

    def never_went(self) -> Explanation:
        assert isinstance(self.test, ActAtFirst | ActAtSome)
        arrival = self.test.stay.arrival
        if not self.trace:
            return self.because(f"the robot did nothing at all, so it {self.never_arrived()}")
        _, detail = _Absence(Exists(arrival, self.test.cuts), (arrival,), self.trace).instead(
            range(*self.window.span)
        )
        never = f"{self.never_arrived()}{self.window.told_until()}, where it was to "
        never += f"{did(self.deed, 'base')}{detail}"
        return self.because(self.window.told_after() + self.robot() + never)

    def robot(self) -> str:
        """The subject, after what should have begun the part of the trace but never happened."""
        never = self.window.never_began()
        said_anyway = isinstance(self.test, ActAtFirst | ActAtSome) and never == self.never_arrived()
        needed = never and not self.window.told_after() and not said_anyway
        return f"the robot {never}; it " if needed else "the robot "

    def never_arrived(self) -> str:
        assert isinstance(self.test, ActAtFirst | ActAtSome)
        return f"never {did((self.test.stay.arrival,), 'past', never=True)}"

    def not_there(self, stay: list[int], place: str, moves: Stay) -> Explanation:
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
        sentence = f"{self.window.told_after()}the robot {went} but {failed}"
        return self.because(
            sentence + self.window.told_until() + detail, arrivals[0] if event is None else event
        )

    def miscounted(self, number: int, least: str) -> Explanation:
        found = [at for at in range(*self.window.span) if _seen(self.deed[0], self.trace, at)]
        if not found:
            never = self.nowhere()
            often = "" if number == 1 else f", but it should have {least}{times(number)}"
            return self.because(never.sentence + often, never.event)
        if number == 0:
            must_not = _presence(Exists(self.deed[0], self.test.cuts), self.trace)
            return self.because(must_not.sentence, must_not.event)
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
            return "" if any(event.kind == "goto" for event in self.trace) else ": it went nowhere"
        names = [room_name(name) for name in rooms]
        shown = names if len(names) <= _MOST else [*names[:_MOST], f"{len(names) - _MOST} more rooms"]
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
        return -min(missing(element.text, event.text) for element in self.deed), -at

    def because(self, sentence: str, event: int | None = None) -> Explanation:
        return Explanation(self.test, event, sentence)


def _why_true(formula: Formula, trace: Trace) -> Explanation:
    match formula:
        case And(parts):
            facts = [_fact(part, trace) for part in parts]
            both = "both" if len(facts) == 2 else "all"  # noqa: PLR2004 - that is what both means
            event = next((fact.event for fact in reversed(facts) if fact.event is not None), None)
            return Explanation(
                Not(formula), event, f"the robot {_joined(facts)}, which must not {both} be so"
            )
        case Or(parts):
            return _why_true(next(part for part in parts if holds(part, trace)), trace)
        case Not(part):
            return _why_false(part, trace)
        case Count(element, 0):
            absence = _Absence(Exists(element, formula.cuts), (element,), trace).explain()
            return Explanation(Not(formula), absence.event, absence.sentence)
        case AtLeast(_, 0):
            sentence = "anything happens at least 0 times, so this can never be satisfied"
            return Explanation(Not(formula), None, sentence)
        case _:
            return _presence(formula, trace)


def _presence(test: Test, trace: Trace) -> Explanation:
    window = Window(test.cuts, trace)
    fact = _fact(test, trace)
    assert fact.event is not None
    began = window.never_began()
    told_anyway = any(at is None and one.name.startswith("Before") for one, at in window.made)
    since = f" (it {began}, so every step counts)" if began and not told_anyway else ""
    if isinstance(test, Count | AtLeast):
        limit = "not be exactly" if isinstance(test, Count) else "be less than"
        sentence = f"the robot {fact.told}{fact.where}, but it must {limit} {times(test.number)}{since}"
        return Explanation(Not(test), fact.event, sentence)
    duties = f", which it must not do{window.duties()}{since}"
    visit = "" if isinstance(test, Exists) else fact.where
    event = trace[fact.event]
    if test.element.kind in {"say", "ask"} and not (
        is_any(test.element.text) and test.element.options is None
    ):
        told = f"{did((test.element,), 'past')} at step {fact.event + 1}{visit}{duties}: it {offered(event)}"
    else:
        told = f"{fact.told}{visit}{duties}"
    return Explanation(Not(test), fact.event, f"the robot {told}")


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


def _fact(formula: Formula, trace: Trace) -> _Fact:  # noqa: PLR0911 - one for each kind of formula
    match formula:
        case And(parts):
            facts = [_fact(part, trace) for part in parts]
            return _Fact(facts[-1].event, _joined(facts))
        case Or(parts):
            return _fact(next(part for part in parts if holds(part, trace)), trace)
        case Not(Not(part)):
            return _fact(part, trace)
        case Not(part):
            reason = _why_false(part, trace)
            told = reason.sentence.removeprefix("the robot ")
            return _Fact(reason.event, told if told != reason.sentence else f"acted so that {told}")
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
    return _Fact(found[max(test.number, 1) - 1], told, window.told())


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
