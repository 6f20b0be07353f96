"""Explanations are true, and read well."""

import re
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from codebotler.rtl import And, CannotJudge, Formula, Not, Or, explain, holds, parse
from codebotler.skills import SKILLS, Parameter, Recording, Skill
from codebotler.trace import Event, Option, Trace

VERBS = {
    "going": "goto",
    "went": "goto",
    "saying": "say",
    "said": "say",
    "asking": "ask",
    "asked": "ask",
    "looking": "check",
    "looked": "check",
    "picking": "pick",
    "picked": "pick",
    "putting": "place",
    "put": "place",
}
STEP = re.compile(rf"\b({'|'.join(VERBS)})\b(?:(?!\b(?:{'|'.join(VERBS)})\b)[^:;])*? (?:at |\()step (\d+)")


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
    except CannotJudge:
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
LUNCH = (
    Event("goto", "alice's office"),
    Event("ask", "do you want lunch?", YES_NO),
    Event("goto", "bob's office"),
    Event("say", "hello bob"),
    Event("goto", "lobby"),
    Event("check", "person"),
    Event("say", "nobody is good"),
)


@pytest.mark.parametrize(
    ("text", "event", "sentence"),
    [
        (
            'tr.ActAtFirst("bob\'s office", ask("lunch", ".*"))',
            1,
            (
                "the robot went to bob's office at step 3 but did not ask about lunch there: "
                "it did so only at step 2, after going to alice's office at step 1"
            ),
        ),
        (
            'tr.ActAtFirst("bob\'s office", ask("dinner", ".*"))',
            2,
            "the robot went to bob's office at step 3 but did not ask about dinner there: it only spoke",
        ),
        (
            'tr.Exists(goto("kitchen"))',
            None,
            "the robot never went to the kitchen: it only went to alice's office, bob's office and the lobby",
        ),
        ('not tr.Exists(goto("lobby"))', 4, "the robot went to the lobby at step 5, which it must not do"),
        ('tr.Exists(pick("mug"))', None, 'the robot never picked up "mug"'),
        (
            'tr.Exists(say(words("good", "day")))',
            6,
            (
                'the robot never said anything with "good" and "day": '
                'it said "nobody is good" at step 7, which lacks "day"'
            ),
        ),
        (
            'tr.BeforeFirst(say("hello")).Exists(check(".*"))',
            5,
            (
                'the robot never looked around before saying "hello bob" at step 4: '
                "it did so only at step 6, too late"
            ),
        ),
        (
            'tr.AfterFirst(goto("lobby")).Exists(ask(".*", ".*"))',
            1,
            (
                "the robot never asked anything after going to the lobby at step 5: "
                "it did so only at step 2, too early"
            ),
        ),
        (
            'tr.Count(say(".*"), 1)',
            6,
            "the robot said something twice (steps 4 and 7) instead of once",
        ),
        (
            'tr.AtLeast(check(".*"), 10)',
            None,
            "the robot looked around once (step 6) instead of at least 10 times",
        ),
        (
            'tr.ActAtFirst("kitchen", pick("mug")) or tr.Exists(pick("mug"))',
            None,
            (
                'one of two things had to be so, but the robot never picked up "mug", and it never went to '
                'the kitchen, where it was to pick up "mug": '
                "it only went to alice's office, bob's office and the lobby"
            ),
        ),
        (
            'tr.Exists(ask("tea", ".*")) or tr.Exists(ask(".*", "tea"))',
            1,
            (
                'the robot never mentioned "tea" in a question or its options: it asked "do you want '
                'lunch?" at step 2, which lacks "tea", and none of its options ("yes" and "no") will do'
            ),
        ),
        (
            'tr.Exists(ask("lunch", "maybe"))',
            1,
            (
                'the robot never asked about lunch with an option with "maybe": it asked "do you want '
                'lunch?" at step 2, but none of its options ("yes" and "no") has "maybe"'
            ),
        ),
        (
            'not (tr.Exists(goto("lobby")) and tr.BeforeFirst(say("hello")).Exists(ask("lunch", ".*")))',
            1,
            (
                'the robot went to the lobby at step 5 and also asked "do you want lunch?" at step 2 '
                'before saying "hello bob" at step 4, which must not both be so'
            ),
        ),
        (
            'not tr.BeforeFirst(goto("kitchen")).Exists(goto("lobby"))',
            4,
            (
                "the robot went to the lobby at step 5, which it must not do before going to the kitchen "
                "(which it never did)"
            ),
        ),
        (
            r'tr.Exists(say(r"\b(7[3-9]|8[0-9])\b"))',
            3,
            (
                "the robot never said anything with a number from 73 to 89: "
                'it said "hello bob" at step 4, which lacks a number from 73 to 89'
            ),
        ),
        (
            'tr.AfterFirst(goto("lobby")).Exists(goto(without("start_loc")))',
            0,
            (
                "the robot never went anywhere but to start_loc after going to the lobby at step 5: "
                "it did so only at steps 1, 3 and 5, too early"
            ),
        ),
    ],
)
def test_sentences(text: str, event: int | None, sentence: str) -> None:
    formula = parse(text)
    why = explain(formula, LUNCH)
    assert why is not None
    assert (why.sentence, why.event) == (sentence, event)
    assert why.clause == formula


def test_the_smallest_clause_is_named() -> None:
    why = explain(
        parse('tr.Exists(goto("lobby")) and not (tr.Exists(pick("x")) or tr.Exists(say("hello")))'), LUNCH
    )
    assert why is not None
    assert why.clause == parse('not tr.Exists(say("hello"))')
    assert why.event == 3


def test_an_empty_trace_is_named() -> None:
    why = explain(parse('tr.ActAtFirst("lobby", say("hello"))'), ())
    assert why is not None
    assert why.sentence == "the robot did nothing at all, so it never went to the lobby"


def test_an_option_that_is_no_text_is_named() -> None:
    trace = (*LUNCH[:4], Event("ask", "how many?", (Option("one"), Option("2", is_text=False))))
    why = explain(parse('tr.Exists(goto("alice")) and not tr.Exists(ask("x", "many"))'), trace)
    assert why is not None
    assert why.event == 4
    assert why.clause == parse('tr.Exists(ask("x", "many"))')
    assert why.sentence == (
        "option 2 of the question at step 5 is no text but 2, so what was required cannot be judged"
    )


def test_a_further_skill_is_told_by_its_name() -> None:
    wave = Skill("wave", (Parameter("person"),), "None", "Wave at a person.", Recording("wave", "person"))
    formula = parse('tr.Exists(wave("alice"))', skills=SKILLS.with_skill(wave))
    why = explain(formula, (Event("wave", "bob"),))
    assert why is not None
    assert why.sentence == (
        'the robot never did a wave with "alice": it did a wave "bob" at step 1, which lacks "alice"'
    )


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
