"""Formulas mean their definitions in RTL.md, which are written out literally here."""

import pickle
import re
from collections.abc import Callable
from dataclasses import fields, replace
from typing import SupportsIndex, TypeAlias, overload

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl import (
    ActAtFirst,
    ActAtSome,
    And,
    AtLeast,
    Claim,
    Count,
    EventPattern,
    Exists,
    Formula,
    Inconclusive,
    Last,
    Not,
    Number,
    Or,
    Regex,
    Scope,
    Test,
    TextPattern,
    Time,
    Without,
    Words,
    holds,
    parse,
)
from codebotler.rtl.semantics import compared_fields, positions_in_scopes

Placed = list[tuple[int, Event]]
"""A copy of a part of a trace, each event with its position in the whole trace."""

YES = Option("yes")
THREE = Option("3", is_text=False)


def goto(room: str) -> Event:
    return Event("goto", room)


def say(message: str) -> Event:
    return Event("say", message)


def ask(question: str, *options: Option) -> Event:
    return Event("ask", question, options)


def regex_of(text: TextPattern) -> str:
    match text:
        case Regex(regex):
            return regex
        case Without(regex):
            return rf"^(?!.*\b(?:{regex})\b).*$"
        case Words(parts):
            return "^" + "".join(f"(?=.*(?:{regex_of(part)}))" for part in parts) + ".*$"
        case Number() | Time() | Claim():
            raise AssertionError("a claim is not a regex; test_claims.py tests claims")


def is_found(text: TextPattern, actual: str) -> bool:
    if isinstance(text, Number | Time | Claim):
        return text.matches(actual)
    if isinstance(text, Words):
        return all(is_found(part, actual) for part in text.parts)
    return re.search(regex_of(text), actual, re.IGNORECASE | re.DOTALL) is not None


def is_same(element: EventPattern, placed: tuple[int, Event]) -> bool:
    at, event = placed
    if event.kind != element.kind:
        return False
    if element.place is not None and not is_found(Regex(rf"\b(?:{element.place})\b"), event.place):
        return False
    held, to, answer = event.holding or None, event.to, event.answer
    for wanted, actual in ((element.holding, held), (element.to, to), (element.answer, answer)):
        if wanted is not None and (actual is None or not is_found(wanted, actual)):
            return False
    if element.found is not None and event.found is not element.found:
        return False
    return matches_text(element, event, at)


def matches_text(element: EventPattern, event: Event, at: int) -> bool:
    if element.mention:
        return any(is_found(element.text, text) for text in (event.text, *(o.text for o in event.options)))
    if element.options is None:
        return is_found(element.text, event.text)
    offered = False
    for number, option in enumerate(event.options):
        if not option.is_text:
            raise Inconclusive(at, number, option)
        if is_found(element.options, option.text):
            offered = True
            break
    return is_found(element.text, event.text) and offered


def exists(tr: Placed, e: EventPattern) -> bool:
    return any(is_same(e, event) for event in tr)


def after_first(tr: Placed, e: EventPattern) -> Placed:
    return next((tr[i + 1 :] for i, event in enumerate(tr) if is_same(e, event)), tr)


def before_first(tr: Placed, e: EventPattern) -> Placed:
    return next((tr[:i] for i, event in enumerate(tr) if is_same(e, event)), tr)


def after_last(tr: Placed, e: EventPattern) -> Placed:
    hits = [i for i, event in enumerate(tr) if is_same(e, event)]
    return tr[hits[-1] + 1 :] if hits else tr


def before_last(tr: Placed, e: EventPattern) -> Placed:
    hits = [i for i, event in enumerate(tr) if is_same(e, event)]
    return tr[: hits[-1]] if hits else tr


def act_at_first(tr: Placed, p: str, e: EventPattern) -> bool:
    there, away = EventPattern("goto", Regex(p)), EventPattern("goto", Without(p))
    return exists(tr, there) and exists(before_first(after_first(tr, there), away), e)


def act_at_some(tr: Placed, p: str, e: EventPattern) -> bool:
    there = EventPattern("goto", Regex(p))
    return exists(tr, there) and (act_at_first(tr, p, e) or act_at_some(after_first(tr, there), p, e))


def at_least(tr: Placed, e: EventPattern, n: int) -> bool:
    return n == 0 or (exists(tr, e) and at_least(after_first(tr, e), e, n - 1))


def count(tr: Placed, e: EventPattern, n: int) -> bool:
    return at_least(tr, e, n) and not at_least(tr, e, n + 1)


def only(scope: Callable[[Placed, EventPattern], Placed]) -> Callable[[Placed, EventPattern], Placed]:
    return lambda tr, e: scope(tr, e) if exists(tr, e) else []


SCOPES: dict[str, Callable[[Placed, EventPattern], Placed]] = {
    "BeforeFirst": before_first,
    "BeforeLast": before_last,
    "AfterFirst": after_first,
    "AfterLast": after_last,
    "OnlyBeforeFirst": only(before_first),
    "OnlyBeforeLast": only(before_last),
    "OnlyAfterFirst": only(after_first),
    "OnlyAfterLast": only(after_last),
}


def holds_by_definition(formula: Formula, trace: Trace) -> bool:
    match formula:
        case And(parts):
            return all(holds_by_definition(part, trace) for part in parts)
        case Or(parts):
            return any(holds_by_definition(part, trace) for part in parts)
        case Not(part):
            return not holds_by_definition(part, trace)
        case _:
            tr = list(enumerate(trace))
            for one in formula.scopes:
                tr = SCOPES[one.name](tr, one.element)
            return single_test_holds(formula, tr)


def single_test_holds(test: Test, tr: Placed) -> bool:
    match test:
        case Exists(e):
            return exists(tr, e)
        case Last(e):
            return bool(tr) and is_same(e, tr[-1])
        case ActAtFirst(p, e):
            return act_at_first(tr, p, e)
        case ActAtSome(p, e):
            return act_at_some(tr, p, e)
        case AtLeast(e, n):
            return at_least(tr, e, n)
        case Count(e, n):
            return count(tr, e, n)


Verdict = bool | tuple[int, int, Option]


def verdict(judge: Callable[[Formula, Trace], bool], formula: Formula, trace: Trace) -> Verdict:
    try:
        return judge(formula, trace)
    except Inconclusive as error:
        return error.event, error.number, error.option


@given(st.data())
def test_tests_mean_their_definitions(
    single_tests: SearchStrategy[Test], mixed_traces: SearchStrategy[Trace], data: DataObject
) -> None:
    test, trace = data.draw(single_tests), data.draw(mixed_traces)
    assert verdict(holds, test, trace) == verdict(holds_by_definition, test, trace)


@given(st.data())
def test_formulas_mean_their_definitions(
    formulas: SearchStrategy[Formula], mixed_traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(mixed_traces)
    assert verdict(holds, formula, trace) == verdict(holds_by_definition, formula, trace)


@given(st.data())
def test_stays_mean_their_definition(data: DataObject) -> None:
    """Some room names contain others, so a stay may begin within a stay."""
    moves = st.sampled_from(["a", "ab", "a b", "b"]).map(goto)
    trace = tuple(data.draw(st.lists(moves | st.just(say("x")), max_size=9)))
    for test in (ActAtSome, ActAtFirst):
        for kind in ("say", "goto"):
            formula = test(data.draw(st.sampled_from(["a", "b"])), EventPattern(kind, Regex("x|b")))
            assert holds(formula, trace) == holds_by_definition(formula, trace)


@given(st.data())
def test_negation_inverts_every_verdict(
    formulas: SearchStrategy[Formula], mixed_traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(mixed_traces)
    plain, negated = verdict(holds, formula, trace), verdict(holds, Not(formula), trace)
    assert negated == (not plain if isinstance(plain, bool) else plain)


@given(st.data())
def test_count_is_the_largest_at_least(
    elements: SearchStrategy[EventPattern], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    element, trace = data.draw(elements), data.draw(traces)
    numbers = [n for n in range(len(trace) + 2) if holds(Count(element, n), trace)]
    assert numbers == [max(n for n in range(len(trace) + 2) if holds(AtLeast(element, n), trace))]


@given(st.data())
def test_parts_before_and_after_an_event_make_up_the_trace(
    elements: SearchStrategy[EventPattern], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    element, trace = data.draw(elements), data.draw(traces)
    hits = [at for at in range(len(trace)) if is_same(element, (at, trace[at]))]
    for which, at in (("First", hits[:1]), ("Last", hits[-1:])):
        before, after = (
            positions_in_scopes(parse_scope(side + which, element), trace) for side in ("Before", "After")
        )
        if not at:
            assert before == after == range(len(trace))
        else:
            assert before == range(at[0])
            assert after == range(at[0] + 1, len(trace))


def parse_scope(name: str, element: EventPattern) -> tuple[Scope, ...]:
    formula = parse(f"tr.{name}({element}).Exists(say('x'))")
    assert isinstance(formula, Exists)
    return formula.scopes


@given(st.data())
def test_events_that_a_formula_does_not_name_change_nothing(
    formulas: SearchStrategy[Formula], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(traces)
    padded = tuple(event for one in trace for event in (Event("wave", "a"), one))
    assert holds(formula, padded) == holds(formula, trace)


def test_every_field_that_formulas_compare_is_visible() -> None:
    event = Event("say", "a")
    other = Event(
        *("ask", "b", (Option("1"),), "c"),
        found=True,
        place="d",
        time=2.0,
        holding="e",
        to="f",
        more=("g",),
        destination="h",
        failed="i",
    )
    hidden = {"time", "destination", "failed"}
    for name in (one.name for one in fields(Event)):
        changed = replace(event, **{name: getattr(other, name)})
        assert (compared_fields((changed,)) == compared_fields((event,))) == (name in hidden), name


@given(st.data())
def test_equally_visible_traces_have_the_same_verdict(
    formulas: SearchStrategy[Formula], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(traces)
    later = tuple(replace(event, time=9.0 + at) for at, event in enumerate(trace))
    assert compared_fields(later) == compared_fields(trace)
    assert holds(formula, later) == holds(formula, trace)


AnySlice: TypeAlias = "slice[SupportsIndex | None, SupportsIndex | None, SupportsIndex | None]"


class CountingTrace(tuple[Event, ...]):  # noqa: SLOT001 - it needs a counter
    """Count how often an event of the trace is read."""

    number = 0

    @overload
    def __getitem__(self, at: SupportsIndex, /) -> Event: ...
    @overload
    def __getitem__(self, at: AnySlice, /) -> tuple[Event, ...]: ...
    def __getitem__(self, at: "SupportsIndex | AnySlice", /) -> Event | tuple[Event, ...]:
        assert not isinstance(at, slice), "a copy was made"
        self.number += 1
        return super().__getitem__(at)


@pytest.mark.parametrize(
    "text",
    [
        'tr.ActAtSome("a", pick("x"))',
        'tr.ActAtFirst("a", pick("x"))',
        'tr.Count(goto("a"), 500)',
        'tr.Count(goto("."), 5000)',
        'tr.AtLeast(say("."), 5000)',
        'tr.AfterLast(goto("a")).BeforeLast(say(".")).AfterFirst(goto("b")).BeforeFirst(pick("x")).Exists(place("x"))',
    ],
)
@pytest.mark.parametrize(
    "turn", [[goto("a"), say("x"), goto("b")], [goto("a"), say("x")], [say("x"), goto("a")]], ids=str
)
def test_judging_takes_linear_time(text: str, turn: list[Event]) -> None:
    formula = parse(text)
    for turns in (10, 1000):
        trace = CountingTrace(turn * turns)
        holds(formula, trace)
        assert trace.number <= 5 * len(trace)


def test_option_that_is_not_text_is_inconclusive_for_any_question() -> None:
    trace = (ask("lunch", YES, THREE),)
    for text in (
        'tr.Exists(ask("lunch", "no"))',
        'tr.Exists(ask("dinner", "no"))',
        'not tr.Exists(ask("x", "no"))',
    ):
        with pytest.raises(Inconclusive) as caught:
            holds(parse(text), trace)
        assert (caught.value.event, caught.value.number, caught.value.option) == (0, 1, THREE)


def test_options_are_compared_until_one_matches() -> None:
    assert holds(parse('tr.Exists(ask("lunch", "yes"))'), (ask("lunch", YES, THREE),))
    assert not holds(parse('tr.Exists(ask("dinner", "yes"))'), (ask("lunch", YES, THREE),))


def test_counting_stops_at_the_event_that_decides() -> None:
    good, bad = ask("lunch", YES), ask("lunch", THREE)
    assert not holds(parse('tr.Count(ask(".*", "yes"), 0)'), (good, bad))
    assert not holds(parse('tr.Count(ask(".*", "yes"), 1)'), (good, good, bad))
    with pytest.raises(Inconclusive):
        holds(parse('tr.Count(ask(".*", "yes"), 1)'), (good, bad))


@pytest.mark.parametrize("scope", ["AfterFirst", "AfterLast", "BeforeFirst", "BeforeLast"])
@pytest.mark.parametrize("times", [1, 2])
def test_part_excludes_the_event_that_bounds_it(scope: str, times: int) -> None:
    formula = parse(f'tr.{scope}(say("a")).Exists(say("a"))')
    assert holds(formula, (say("a"),) * times) is (times == 2 and scope in {"AfterFirst", "BeforeLast"})


def test_only_ask_elements_read_options() -> None:
    assert not holds(parse('tr.Exists(say("x"))'), (ask("x", THREE),))
    assert holds(parse('tr.Exists(goto("x")) or tr.Exists(ask("x", ".*"))'), (goto("x"), ask("x", THREE)))
    assert holds(parse('tr.AtLeast(ask("x", ".*"), 0)'), (ask("x", THREE),))


def test_a_question_without_options_matches_no_options() -> None:
    assert not holds(parse('tr.Exists(ask(".*", ".*"))'), (ask("lunch"),))


@pytest.mark.parametrize(
    ("text", "actual", "matches"),
    [
        ('"lobby"', "the Lobby", True),
        ('"a.b"', "a\nb", True),
        ('words("5|five", "lobby")', "in the lobby at five", True),
        ('words("5|five", "lobby")', "in the lobby", False),
        ('words("no")', "I know", True),
        ('without("no")', "I know", True),
        ('without("no")', "No, thanks", False),
        ('without("a|b")', "x b", False),
        ('words("alice", without("no"))', "alice joins", True),
        ('words("alice", without("no"))', "no alice", False),
        ('words(r"(x)\\1", r"(y)\\1")', "yyxx", True),
    ],
)
def test_text_patterns_match_as_defined(text: str, actual: str, matches: bool) -> None:  # noqa: FBT001 - a row of a table
    assert holds(parse(f"tr.Exists(say({text}))"), (say(actual),)) is matches


YES_FORMULA = 'tr.AfterFirst(goto("alice\'s office")).AfterFirst(ask("lunch", ".*")).Exists(say("lobby"))'
NO_FORMULA = (
    'tr.AfterFirst(goto("alice\'s office")).Exists(ask("lunch", ".*")) and not '
    'tr.AfterFirst(goto("alice\'s office")).AfterFirst(ask("lunch", ".*")).Exists(say("lobby"))'
)


@pytest.mark.parametrize(
    ("events", "when_yes", "when_no"),
    [
        ([goto("alice's office"), ask("lunch?", YES), say("to the lobby")], True, False),
        ([goto("alice's office"), ask("lunch?", YES)], False, True),
        ([goto("alice's office"), say("to the lobby"), ask("lunch?", YES)], False, True),
        ([ask("lunch?", YES), goto("alice's office")], False, False),
        ([], False, False),
        # A scope whose event is missing is the whole trace, which is easy to overlook.
        ([say("to the lobby")], True, False),
    ],
)
def test_example_of_the_paper_has_its_verdicts(events: list[Event], when_yes: bool, when_no: bool) -> None:  # noqa: FBT001 - a row of a table
    assert holds(parse(YES_FORMULA), tuple(events)) is when_yes
    assert holds(parse(NO_FORMULA), tuple(events)) is when_no


def test_inconclusive_error_can_be_pickled() -> None:
    error = pickle.loads(pickle.dumps(Inconclusive(4, 1, THREE)))
    assert (error.event, error.number, error.option) == (4, 1, THREE)
    assert str(error) == "option 2 of the question at step 5 is not a string: 3"
