"""Every sentence that explains a failure, word by word."""

from pathlib import Path

import pytest

from codebotler.core.skills import SKILLS, Parameter, Recording, Skill
from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl import explain, parse

WAVE = Skill("wave", (Parameter("person"),), "None", "Wave at a person.", Recording("wave", "person"))
WITH_WAVE = SKILLS.with_skill(WAVE)

YES_NO = (Option("yes"), Option("no"))
NOTHING: Trace = ()
LUNCH: Trace = (
    Event("goto", "alice's office"),
    Event("ask", "do you want lunch?", YES_NO),
    Event("goto", "bob's office"),
    Event("say", "hello bob"),
    Event("goto", "lobby"),
    Event("check", "person"),
    Event("say", "nobody is good"),
)
TWICE: Trace = (
    Event("goto", "lobby"),
    Event("say", "hi"),
    Event("goto", "lobby"),
    Event("goto", "kitchen"),
    Event("say", "tea"),
    Event("goto", "lobby"),
    Event("pick", "mug"),
    Event("say", "hi again"),
)
ODD: Trace = (
    Event("ask", "many?", tuple(Option(f"o{number}") for number in range(7))),
    Event("ask", "bare"),
    Event("wave", "bob"),
    Event("goto", "Room 7"),
    Event("goto", ""),
    Event("place", "red cup"),
    Event("goto", "the attic"),
    Event("say", "short"),
    Event("say", "two\nlines"),
)
OFTEN: Trace = (*(Event("goto", f"room {number}") for number in range(7)), *[Event("say", "a")] * 7)
LONG: Trace = (
    Event("goto", "x" * 80),
    Event("say", "x" * 70),
    Event("say", "y" * 71),
    Event("ask", "how many?", (Option("one"), Option("[2,\n 3]", is_text=False))),
)
CHAT: Trace = (
    Event("ask", "tea?", YES_NO),
    Event("ask", "tea or cake?", YES_NO),
    Event("ask", "cake?", YES_NO),
    Event("wave", "bob"),
    Event("say", "no cake"),
)
NUMBERS: Trace = (
    Event("ask", "which?", tuple(Option(str(number)) for number in range(5))),
    Event("ask", "whose?", (Option("1" * 71, is_text=False),)),
    *[Event("say", "go")] * 1010,
)
DONE: Trace = (
    Event("wave", "bob"),
    Event("check", "cat"),
    Event("pick", "mug"),
    Event("place", "mug"),
    Event("goto", "an attic"),
    Event("wave", "tom"),
    Event("check", "dog"),
    Event("ask", "ok?", YES_NO),
    Event("pick", "cup"),
    Event("place", "cup"),
    Event("goto", "alice's room"),
    Event("goto", "Hall"),
)
SPACES: Trace = (Event("say", "a" + " " * 80 + "b"),)
TRACES = {
    "LUNCH": LUNCH,
    "TWICE": TWICE,
    "NOTHING": NOTHING,
    "ODD": ODD,
    "OFTEN": OFTEN,
    "LONG": LONG,
    "CHAT": CHAT,
    "NUMBERS": NUMBERS,
    "DONE": DONE,
    "SPACES": SPACES,
}

# Of each explanation: the trace and the step that is to blame, the formula, the sentence.
TABLE = Path(__file__).with_name("sentences.txt").read_text(encoding="utf-8").strip().split("\n\n")


@pytest.mark.parametrize("explanation", TABLE)
def test_sentence(explanation: str) -> None:
    where, text, sentence = explanation.splitlines()
    trace, _, step = where.partition(" step ")
    why = explain(parse(text, skills=WITH_WAVE), TRACES[trace])
    assert why is not None
    assert (why.sentence, why.event) == (sentence, int(step) - 1 if step else None)


@pytest.mark.parametrize(
    ("text", "clause"),
    [
        ('tr.Exists(pick("x")) and tr.Exists(say("x"))', 'tr.Exists(pick("x"))'),
        ('tr.Exists(say("hi")) and tr.Exists(say("x"))', 'tr.Exists(say("x"))'),
        ('not not tr.Exists(say("x"))', 'tr.Exists(say("x"))'),
        ('not (tr.Exists(pick("x")) or tr.Exists(say("hi")))', 'not tr.Exists(say("hi"))'),
        ('not (tr.Exists(say("hi")) and tr.Exists(say("tea")))',) * 2,
        ('tr.Exists(pick("x")) or tr.Exists(place("x"))',) * 2,
        ('tr.Exists(ask("x", ".*")) or tr.Exists(ask(".*", "x"))',) * 2,
        ('tr.Count(say("x"), 1)',) * 2,
        ('tr.Count(say("hi"), 0)',) * 2,
        ('tr.Count(say(".*"), 2)',) * 2,
        ('tr.ActAtFirst("lobby", pick("mug"))',) * 2,
        ('tr.ActAtSome("attic", pick("mug"))',) * 2,
        ('not tr.Count(say("x"), 0)',) * 2,
        ('not tr.AtLeast(say("hi"), 0)',) * 2,
        ('not tr.AtLeast(say("hi"), 1)',) * 2,
        ('not tr.AtLeast(say("hi"), 2)',) * 2,
        ('not tr.Exists(say("hi"))',) * 2,
        ('not tr.ActAtSome("lobby", say("hi"))',) * 2,
    ],
)
def test_clause(text: str, clause: str) -> None:
    why = explain(parse(text), TWICE)
    assert why is not None
    assert str(why.clause) == clause


@pytest.mark.parametrize(
    ("text", "clause"),
    [
        (
            'tr.Exists(pick("z")) or not (tr.Exists(say("z")) or tr.Exists(ask("a", "b")))',
            'tr.Exists(ask("a", "b"))',
        ),
        ('tr.Exists(goto("x")) and not not tr.Exists(ask("a", "b"))', 'tr.Exists(ask("a", "b"))'),
        ('tr.ActAtSome("x", ask("a", "b"))',) * 2,
    ],
)
def test_clause_that_cannot_be_judged(text: str, clause: str) -> None:
    why = explain(parse(text), LONG)
    assert why is not None
    assert str(why.clause) == clause


def test_what_holds_needs_no_explanation() -> None:
    assert explain(parse('tr.Exists(say("hi"))'), TWICE) is None
