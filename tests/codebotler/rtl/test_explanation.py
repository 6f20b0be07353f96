"""Explanations of failures: right for each kind, true, short and found in linear time."""

import re
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from codebotler.core.skills.declaration import POSE_IN_ROOM
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Recording, Skill
from codebotler.core.skills.values import NO_VALUE
from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl import Formula, Inconclusive, Not, explain, holds, parse

WAVE = Skill("wave", (Parameter("person"),), NO_VALUE, "Wave at a person.", Recording("wave", "person"))
YES_NO = (Option("yes"), Option("no"))
LUNCH: Trace = (
    Event("goto", "alice's office"),
    Event("ask", "do you want lunch?", YES_NO, "yes", place="alice's office"),
    Event("goto", "bob's office"),
    Event("say", "hello bob", place="bob's office"),
    Event("goto", "lobby"),
    Event("check", "person"),
    Event("say", "nobody is good"),
)
TWICE: Trace = (
    Event("goto", "lobby"),
    Event("say", "hi"),
    Event("goto", "kitchen"),
    Event("say", "tea"),
    Event("goto", "lobby"),
    Event("pick", "mug"),
    Event("wave", "tom"),
)

# Each row holds a formula, the words of its explanation on LUNCH in order, and the step to blame.
SENTENCES = Path(__file__).with_name("sentences.txt").read_text(encoding="utf-8").strip().split("\n\n")


@pytest.mark.parametrize("row", SENTENCES)
def test_explanation_has_the_expected_words_and_step(row: str) -> None:
    text, words, step = row.splitlines()
    why = explain(parse(text), LUNCH)
    assert why is not None
    assert re.match(f"the robot {'.*'.join(map(re.escape, words.split(' ... ')))}", why.sentence), (
        why.sentence
    )
    assert ("no step" if why.event is None else f"step {why.event + 1}") == step


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            'tr.ActAtFirst("lobby", pick("mug"))',
            'at step 1 but did not pick up "mug" during that stay: it did so only at step 6',
        ),
        ('tr.ActAtSome("kitchen", pick("mug"))', "at step 3 but .* there: it did so only at step 6"),
        (
            'tr.ActAtFirst("kitchen", goto("attic"))',
            "went to the kitchen at step 3 but did not go to the attic",
        ),
        (
            'tr.ActAtSome("lobby", place("mug"))',
            "at steps 1 and 5 but .*: it only spoke, picked .* and did wave",
        ),
        ('tr.Exists(wave("bob"))', 'never did wave "bob": it only did wave "tom" \\(step 7\\)'),
    ],
)
def test_explanation_mentions_other_visits_and_own_skills(text: str, sentence: str) -> None:
    why = explain(parse(text, skills=SKILLS.with_skill(WAVE)), TWICE)
    assert why is not None
    assert re.search(sentence, why.sentence)


@pytest.mark.parametrize(
    ("text", "means", "words"),
    [
        (
            r'tr.AfterFirst(goto("bob")).Exists(say(denies("\d")))',
            "that nobody is in",
            "never said, after .*, that nobody is in",
        ),
        (
            r'tr.ActAtSome("bob", say(denies("\d")))',
            "that nobody is in",
            "did not say there that nobody is in",
        ),
        ('not tr.Exists(say("hello"))', "a greeting", 'said a greeting at step 4.*: it said "hello bob"'),
        (r'tr.Exists(say("x+y?z"))', "something new", "never said anything new"),
        ('tr.Exists(pick("x")) and tr.Exists(say(".*"))', "a greeting", 'never picked up "x"$'),
    ],
)
def test_explanation_uses_the_meaning_that_the_task_gives_to_texts(text: str, means: str, words: str) -> None:
    why = explain(parse(text, means={"say": means}), LUNCH)
    assert why is not None
    assert re.search(words, why.sentence), why.sentence


def test_equal_facts_are_explained_once() -> None:
    either = r'tr.Exists(say(denies("\d+"))) or tr.Exists(say(affirms("\d+")))'
    why = explain(parse(either, means={"say": "that nobody is in"}), LUNCH)
    assert why is not None
    assert why.sentence.count("nobody is in") == 1


def test_explanation_of_an_idle_robot_says_that_it_did_nothing() -> None:
    why = explain(parse('tr.ActAtSome("lobby", say("x"))'), ())
    assert why is not None
    assert why.sentence.endswith(
        'never went to the lobby, where it was to say something with "x": it did nothing at all'
    )
    stayed = explain(parse('tr.ActAtFirst("lobby", say("x"))'), (Event("goto", "lobby"),))
    assert stayed is not None
    assert stayed.sentence.endswith("there: it did nothing there")


def test_option_that_is_not_text_is_the_explanation() -> None:
    trace = (Event("ask", "how many?", (Option("one"), Option("[2,\n 3]", is_text=False))),)
    why = explain(parse('tr.Exists(ask("many", "x"))'), trace)
    assert why is not None
    assert why.sentence.startswith("option 2 of the question at step 1 is not a string but [2, 3], so")
    assert why.event == 0


def test_formula_that_holds_has_no_explanation() -> None:
    assert explain(parse('tr.Exists(say("hi"))'), TWICE) is None


# --- true

VERBS = {
    **dict.fromkeys(["going", "went"], "goto"),
    **dict.fromkeys(["saying", "said"], "say"),
    **dict.fromkeys(["asking", "asked", "getting", "got"], "ask"),
    **dict.fromkeys(["looking", "looked"], "check"),
    **dict.fromkeys(["picking", "picked"], "pick"),
    **dict.fromkeys(["putting", "put"], "place"),
}
STEP = re.compile(rf"\b({'|'.join(VERBS)})\b(?:(?!\b(?:{'|'.join(VERBS)})\b)[^:;])*? (?:at |\()step (\d+)")


def is_judged_true(formula: Formula, trace: Trace) -> bool:
    try:
        return holds(formula, trace)
    except Inconclusive:
        return False


@given(st.data())
def test_explanations_are_true(
    formulas: SearchStrategy[Formula], mixed_traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(formulas), data.draw(mixed_traces)
    why = explain(formula, trace)
    assert (why is None) == is_judged_true(formula, trace)
    if why is None:
        return
    assert why.event is None or 0 <= why.event < len(trace)
    for verb, step in STEP.findall(why.sentence):
        assert trace[int(step) - 1].kind == VERBS[verb], why.sentence
    steps = [int(step) for step in re.findall(r"steps? (\d+)", why.sentence)]
    assert all(1 <= step <= len(trace) for step in steps)
    assert "  " not in why.sentence
    assert "\n" not in why.sentence


@given(st.data())
def test_quoted_texts_are_those_of_their_steps(
    single_tests: SearchStrategy[Formula], traces: SearchStrategy[Trace], data: DataObject
) -> None:
    formula, trace = data.draw(single_tests), data.draw(traces)
    for one in (formula, Not(formula)):
        why = explain(one, trace)
        for text, step in re.findall(r'said "([^"]*)" \(step (\d+)\)', why.sentence if why else ""):
            assert trace[int(step) - 1].text == text


# --- short, and found in linear time

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
        f'tr.Exists(ask("{LONG}", ".*"))',
        f'tr.Exists(pick("{LONG}"))',
    ],
)
def test_a_long_text_is_shortened(text: str) -> None:
    why = explain(parse(text), (Event("say", "hi"),)) or explain(parse(text), (Event("say", LONG),))
    assert why is not None
    assert "xxx" in why.sentence
    assert len(why.sentence) < 400


@pytest.mark.parametrize(
    "text", ['tr.Exists(say("bye"))', 'tr.Exists(mention("bye"))', 'tr.Exists(goto("bye"))']
)
def test_explanation_of_a_megabyte_is_short(text: str) -> None:
    options = tuple(Option(f"{number} {LONG}") for number in range(9))
    events = [Event("say", LONG), Event("ask", LONG, options), Event("goto", LONG), Event("say", "hi")]
    why = explain(parse(text), tuple(events * 20))
    assert why is not None
    assert len(why.sentence) < 3_000


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
IN_THE_LOBBY = DAY[:5]
MANY_ROOMS = tuple(Event("goto", f"room {number}") for number in range(8))


def measure_seconds(formula: Formula, trace: Trace) -> float:
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
        'tr.ActAtSome("lobby", pick("mug"))',
        'tr.ActAtSome("attic", say("hello"))',
        'tr.Count(say("hello"), 1)',
        'tr.AtLeast(goto("lobby"), 1000000)',
        'tr.AfterFirst(say("hello")).BeforeLast(goto("lobby")).ActAtSome("lobby", say("x"))',
        'tr.ActAtSome("lobby", ask("x", ".*")) or tr.ActAtSome("lobby", ask(".*", "x"))',
        'not tr.ActAtSome("lobby", say("hello"))',
        'not tr.AtLeast(say("hello"), 2)',
        'not (tr.ActAtSome("lobby", say("hello")) and not tr.Exists(say("x")))',
    ],
)
def test_explanation_takes_linear_time(text: str) -> None:
    formula, times = parse(text), 8
    days = [day + day[-1:] * (8 - len(day)) for day in (DAY, IN_THE_LOBBY, IN_THE_LOBBY[:3], MANY_ROOMS)]
    short = sum(measure_seconds(formula, day * 30) for day in days)
    long = sum(measure_seconds(formula, day * 30 * times) for day in days)
    assert long < 4 * times * short  # quadratic time would make it 8 * times


def test_explanation_of_a_pose_names_the_room() -> None:
    formula = parse('not tr.Exists(inside("server room"))', skills=SKILLS.with_skill(POSE_IN_ROOM))
    found = explain(formula, (Event("goto", "hall"), Event("inside", "server room")))
    assert found is not None
    assert found.event == 1
    assert "was inside the server room" in found.sentence
