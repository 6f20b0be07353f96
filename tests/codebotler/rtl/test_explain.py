"""Explanations are true, and take no longer than they must."""

import re
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl import And, Formula, Inconclusive, Not, Or, explain, holds, parse

VERBS = {
    "going": "goto",
    "went": "goto",
    "saying": "say",
    "said": "say",
    "asking": "ask",
    "asked": "ask",
    "mentioning": "ask",
    "mentioned": "ask",
    "getting": "ask",
    "got": "ask",
    "looking": "check",
    "looked": "check",
    "picking": "pick",
    "picked": "pick",
    "putting": "place",
    "put": "place",
}
STEP = re.compile(rf"\b({'|'.join(VERBS)})\b(?:(?!\b(?:{'|'.join(VERBS)})\b)[^:;])*? (?:at |\()step (\d+)")


LONG = "x" * 5_000


@pytest.mark.parametrize(
    "text",
    [
        f'tr.Exists(goto("{LONG}"))',
        f'tr.Exists(goto("{LONG}+"))',
        f'tr.Exists(say("{LONG}"))',
        f'tr.Exists(say("{LONG}+"))',
        rf'tr.Exists(say(r"\b{LONG}\b"))',
        f'tr.Exists(say(without("{LONG}")))',
        f'tr.Exists(say(without("{LONG}+")))',
        rf'tr.Exists(say(r"^(?!{LONG}\b)"))',
        f'tr.Exists(ask("{LONG}", ".*"))',
        f'tr.Exists(pick("{LONG}"))',
    ],
)
def test_a_long_text_of_a_formula_is_shortened(text: str) -> None:
    why = explain(parse(text), (Event("say", "hi"),))
    why = why or explain(parse(text), (Event("say", LONG),))
    assert why is not None
    assert "xxx" in why.sentence
    assert len(why.sentence) < 400


def subformulas(formula: Formula) -> list[Formula]:
    match formula:
        case And(parts) | Or(parts):
            return [formula, *(inner for part in parts for inner in subformulas(part))]
        case Not(part):
            return [formula, *subformulas(part)]
        case _:
            return [formula]


def judged(formula: Formula, trace: Trace) -> bool:
    try:
        return holds(formula, trace)
    except Inconclusive:
        return False


@settings(max_examples=150)
@given(st.data())
def test_explanations_are_true(
    formulas: SearchStrategy[Formula], odd_traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(odd_traces)
    why = explain(formula, trace)
    assert (why is None) == judged(formula, trace)
    if why is None:
        return
    parts = subformulas(formula)
    assert why.clause in parts or (isinstance(why.clause, Not) and why.clause.part in parts)
    assert not judged(why.clause, trace)
    assert why.event is None or 0 <= why.event < len(trace)
    for verb, step in STEP.findall(why.sentence):
        assert trace[int(step) - 1].kind == VERBS[verb], why.sentence
    steps = [int(step) for step in re.findall(r"steps? (\d+)", why.sentence)]
    assert all(1 <= step <= len(trace) for step in steps)
    assert "  " not in why.sentence
    assert "\n" not in why.sentence


@given(st.data())
def test_whatever_is_quoted_was_said(
    single_tests: SearchStrategy[Formula], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(single_tests), data.draw(traces)
    for one in (formula, Not(formula)):
        why = explain(one, trace)
        for text, step in re.findall(r'said "([^"]*)" at step (\d+)', why.sentence if why else ""):
            assert trace[int(step) - 1].text == text


YES_NO = (Option("yes"), Option("no"))
DAY = (
    Event("goto", "lobby"),
    Event("say", "hello"),
    Event("goto", "lobby"),
    Event("ask", "lunch?", YES_NO),
    Event("check", "mug"),
    Event("goto", "kitchen"),
    Event("pick", "mug"),
    Event("place", "mug"),
)
STAYING = DAY[:5]
MANY_ROOMS = tuple(Event("goto", f"room {number}") for number in range(8))


def seconds(formula: Formula, trace: Trace) -> float:
    taken = []
    for _ in range(3):
        start = time.process_time()
        explain(formula, trace)
        taken.append(time.process_time() - start)
    return min(taken)


@pytest.mark.parametrize(
    "text",
    [
        'tr.Exists(say("x"))',
        'tr.Exists(goto("attic"))',
        'tr.Exists(ask("x", "y"))',
        'tr.ActAtFirst("lobby", say("x"))',
        'tr.ActAtSome("lobby", say("x"))',
        'tr.ActAtSome("lobby", pick("mug"))',
        'tr.ActAtSome("attic", say("hello"))',
        'tr.Count(say("hello"), 1)',
        'tr.Count(say("hello"), 0)',
        'tr.AtLeast(goto("lobby"), 1000000)',
        'tr.AfterFirst(say("hello")).BeforeLast(goto("lobby")).ActAtSome("lobby", say("x"))',
        'tr.ActAtSome("lobby", say("x")) or tr.ActAtFirst("lobby", say("x"))',
        'tr.ActAtSome("lobby", ask("x", ".*")) or tr.ActAtSome("lobby", ask(".*", "x"))',
        'not tr.ActAtSome("lobby", say("hello"))',
        'not tr.ActAtFirst("lobby", place("mug"))',
        'not tr.AtLeast(say("hello"), 2)',
        'not tr.Exists(goto("lobby"))',
        'not (tr.ActAtSome("lobby", say("hello")) and not tr.Exists(say("x")))',
    ],
)
def test_the_time_grows_with_the_trace_and_no_faster(text: str) -> None:
    formula, times = parse(text), 16
    days = [day + day[-1:] * (8 - len(day)) for day in (DAY, STAYING, STAYING[:3], MANY_ROOMS)]
    short = sum(seconds(formula, day * 30) for day in days)
    long = sum(seconds(formula, day * 30 * times) for day in days)
    assert long < 4 * times * short  # were it quadratic, it would be 16 * times


def test_among_very_long_texts_the_nearest_is_not_looked_for() -> None:
    said = Event("say", "x" * 9_999)
    formula = parse('tr.Exists(say("bye"))')
    few, many = explain(formula, (said,)), explain(formula, (said,) * 99)
    assert few is not None
    assert many is not None
    assert (few.event, many.event) == (0, None)
    assert many.sentence.startswith("the robot never said")
