"""Formulas are parsed from text and printed again."""

import pickle
import re
import unicodedata

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from codebotler.core.skills.declaration import POSE_IN_ROOM
from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import Parameter, Recording, Skill, SkillTable
from codebotler.core.skills.values import NO_VALUE
from codebotler.core.trace import Event
from codebotler.rtl import (
    ActAtFirst,
    And,
    AtLeast,
    Count,
    EventPattern,
    Exists,
    Formula,
    Not,
    Or,
    Regex,
    RtlSyntaxError,
    Scope,
    Without,
    Words,
    holds,
    parse,
)
from codebotler.rtl.syntax import MAX_FORMULA_DEPTH

LOBBY = Exists(EventPattern("goto", Regex("lobby")))
ASK = EventPattern("ask", Regex("lunch"), Regex(".*"))


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        ('tr.Exists(goto("lobby"))', LOBBY),
        ("  tr.Exists(\n  goto('lobby')) ", LOBBY),
        ('tr.Exists(goto("lob" "by"))', LOBBY),
        ('tr.ActAtFirst("lobby", ask("lunch", ".*"))', ActAtFirst("lobby", ASK)),
        ('tr.Count(goto("lobby"), 0)', Count(LOBBY.element, 0)),
        (
            'tr.AfterFirst(goto(without("x"))).BeforeLast(ask("lunch", ".*")).AtLeast(goto("lobby"), 2)',
            AtLeast(
                LOBBY.element,
                2,
                (Scope("AfterFirst", EventPattern("goto", Without("x"))), Scope("BeforeLast", ASK)),
            ),
        ),
        (
            r'tr.Exists(say(words("5|five", without("no"), r"^(?!not\b)")))',
            Exists(EventPattern("say", Words((Regex("5|five"), Without("no"), Regex(r"^(?!not\b)"))))),
        ),
    ],
)
def test_text_is_parsed(text: str, formula: Formula) -> None:
    assert parse(text) == formula


def test_and_binds_closer_than_or_and_not_closest() -> None:
    a = 'tr.Exists(goto("lobby"))'
    assert parse(f"{a} or not {a} and {a}\n or {a}") == Or((LOBBY, And((Not(LOBBY), LOBBY)), LOBBY))
    assert parse(f"not ({a} or {a})") == Not(Or((LOBBY, LOBBY)))


@pytest.mark.parametrize(
    "text",
    [
        'tr.Exists(goto("lobby")) and (tr.Exists(goto("lobby")) or not tr.Exists(goto("lobby")))',
        'not (tr.Exists(goto("lobby")) and (tr.Exists(goto("lobby")) and tr.Exists(goto("lobby"))))',
        'tr.Exists(goto("lobby")) and tr.Exists(goto("lobby")) or tr.Exists(goto("lobby"))',
        r'tr.Exists(say(r"\b(7[3-9]|8[0-9])\b"))',
        'tr.Exists(say("alice\'s office"))',
        "tr.Exists(say('a \"big\" room'))",
        r'tr.Exists(say(r"a\\"))',
    ],
)
def test_formula_is_printed_as_written(text: str) -> None:
    assert str(parse(text)) == text


def test_mixed_chains_print_with_brackets() -> None:
    a = 'tr.Exists(goto("lobby"))'
    assert str(parse(f"{a} and {a} or {a}")) == f"{a} and {a} or {a}"
    assert str(parse(f"{a} and ({a} or {a})")) == f"{a} and ({a} or {a})"


@given(st.data())
def test_formula_survives_the_round_trip(formulas: SearchStrategy[Formula], data: DataObject) -> None:
    formula = data.draw(formulas)
    assert parse(str(formula)) == formula
    assert hash(parse(str(formula))) == hash(formula)


@given(st.data())
def test_strange_texts_survive_printing(strange_formulas: SearchStrategy[Formula], data: DataObject) -> None:
    formula = data.draw(strange_formulas)
    assert parse(str(formula)) == formula


@pytest.mark.filterwarnings("ignore::FutureWarning")
@example(r"a\\d")
@example("\x8a\u0300")
@given(st.text(max_size=8).map(lambda text: unicodedata.normalize("NFC", text.replace("\b", ""))))
def test_raw_patterns_survive_printing(pattern: str) -> None:
    try:
        re.compile(pattern)
    except re.error:
        assume(condition=False)
    formula = Exists(EventPattern("say", Regex(pattern)))
    assert parse(str(formula)) == formula


@pytest.mark.parametrize(
    ("text", "column", "named"),
    [
        ("", 1, "expected a formula"),
        ("tr", 1, "expected a test"),
        ("1 + 1", 1, "expected a test"),
        ('tr.Exists(say("a"))()', 1, "expected a test"),
        ('tr.Exist(goto("a"))', 4, "Exist; .*Exists"),
        ('not tr.Exists(got("a"))', 15, "got; .*goto"),
        ('  tr.Exists(say(word("a")))', 17, "word; .*words"),
        ('tr.Exists(say("é"), 2)', 4, "Exists .*1 argument, .*2"),
        ('tr.Exists(say("é")) and tr.Exists(say(3))', 39, "expected a string"),
        ('tr.Exists(ask("a"))', 11, "takes a question and an option"),
        ("tr.Exists(say(words()))", 15, "words .*at least one"),
        ('tr.Exists(say(without("a", "b")))', 15, "without .*1 argument, .*2"),
        ('tr.Exists(say(without(words("a"))))', 23, "expected a string"),
        ('tr.Exists(say(text="a"))', 15, "RTL has no keyword arguments"),
        ('tr.Exists(say(f"a"))', 15, "expected a string"),
        ('tr.Exists(say(b"a"))', 15, "expected a string"),
        ("tr.Exists(*say)", 11, "expected an element"),
        ('tr.Exists(say("("))', 15, "not a valid regex"),
        ('tr.ActAtFirst("(", say("a"))', 15, "not a valid regex"),
        ('tr.Exists(say(without("(?#x)(?i)a")))', 23, "whole word"),
        ('tr.Exists(say("\\bno"))', 15, 'write r"..."'),
        ('tr.Count(say("a"), -1)', 20, "expected a whole number"),
        ('tr.Count(say("a"), True)', 20, "expected a whole number"),
        ('tr.Count(say("a"), 1.0)', 20, "expected a whole number"),
        ('tr.AfterFirst(say("a"))', 4, "followed by a test"),
        ('tr.Exists(say("a")).Exists(say("a"))', 4, "Exists is a test"),
        ('tr.After(say("a")).Exists(say("a"))', 4, "After; .*AfterLast"),
        ('trace.Exists(say("a"))', 1, "expected tr or a scope"),
        ('tr.Exists(say("a")) # or\n tr.Exists(say("b"))', 20, "no comments"),
        ('tr.Exists(say("a")', 10, "never closed"),
        ('tr.Exists(say("\ud800"))', 1, "cannot be read"),
        ("\0", 1, "null"),
    ],
)
def test_error_names_the_mistake_and_its_column(text: str, column: int, named: str) -> None:
    with pytest.raises(RtlSyntaxError, match=named) as caught:
        parse(text)
    assert caught.value.column == column
    assert str(caught.value).startswith(f"column {column}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "not " * 60 + 'tr.Exists(say("a"))',
        "not " * 100_000 + 'tr.Exists(say("a"))',
        "(" * 5_000,
        "-" * 100_000 + "1",
        "tr" + '.AfterFirst(say("a"))' * 10_000 + '.Exists(say("a"))',
        'tr.Exists(say("' + "(" * 5_000 + "a" + ")" * 5_000 + '"))',
        'tr.Count(say("a"), ' + "9" * 5_000 + ")",
    ],
    ids=lambda text: text[:12],
)
def test_deep_nesting_is_an_error_instead_of_a_crash(text: str) -> None:
    with pytest.raises(RtlSyntaxError):
        parse(text)


def test_50_levels_are_accepted_and_51_refused() -> None:
    text = "not " * MAX_FORMULA_DEPTH + 'tr.Exists(say("a"))'
    assert str(parse(text)) == text
    with pytest.raises(RtlSyntaxError, match="more than 50 levels deep") as caught:
        parse("not " + text)
    assert caught.value.column == 205


def test_each_part_of_a_formula_may_be_deep() -> None:
    deep = "not " * (MAX_FORMULA_DEPTH - 1) + 'tr.Exists(say("a"))'
    assert str(parse(f"{deep} and {deep}")) == f"{deep} and {deep}"
    with pytest.raises(RtlSyntaxError, match="nested"):
        parse(f"{deep} and not {deep}")


@pytest.mark.parametrize("test", ["Count", "AtLeast"])
def test_a_number_may_be_larger_than_any_trace(test: str) -> None:
    text = f'tr.{test}(say("a"), {10**30})'
    assert str(parse(text)) == text
    assert not holds(parse(text), (Event("say", "a"),))


def test_python_code_is_never_evaluated() -> None:
    with pytest.raises(RtlSyntaxError):
        parse('__import__("os").system("true")')


def test_unknown_escapes_are_read_literally() -> None:
    assert parse(r'tr.Exists(say("\d"))') == parse(r'tr.Exists(say(r"\d"))')


def test_own_skill_adds_an_element() -> None:
    wave = Skill("wave", (Parameter("person"),), NO_VALUE, "Wave at a person.", Recording("wave", "person"))
    formula = parse('tr.Exists(wave("alice"))', skills=SKILLS.with_skill(wave))
    assert formula == Exists(EventPattern("wave", Regex("alice")))
    assert holds(formula, (Event("wave", "Alice"),))
    with pytest.raises(RtlSyntaxError, match="unknown element wave"):
        parse('tr.Exists(wave("alice"))')


LOOK = Event("check", "a person", found=True)
NO_LOOK = Event("check", "person", found=False)
OTHER_LOOK = Event("check", "mug", found=True)


@pytest.mark.parametrize(
    ("trace", "found", "missed"),
    [
        ((), False, False),
        ((OTHER_LOOK,), False, False),
        ((LOOK,), True, False),
        ((NO_LOOK, OTHER_LOOK), False, True),
        ((NO_LOOK, LOOK, OTHER_LOOK), True, False),
        ((LOOK, NO_LOOK), False, True),
        ((NO_LOOK, LOOK, NO_LOOK), False, True),
        ((LOOK, NO_LOOK, LOOK), True, False),
    ],
)
def test_last_look_decides(trace: tuple[Event, ...], found: bool, missed: bool) -> None:  # noqa: FBT001 - a row of a table
    for text, expected in (("last_found", found), ("last_missed", missed)):
        formula = parse(f'{text}("person")')
        assert holds(formula, trace) is expected
        assert parse(str(formula)) == formula


def switch(name: str, sets: str = "", clears: str = "") -> Skill:
    recording = Recording(name, "device", sets=sets, clears=clears)
    return Skill(name, (Parameter("device"),), NO_VALUE, "Switch.", recording)


SWITCHES = SkillTable(
    (
        *SKILLS.rows,
        *(switch("turn_on", "on"), switch("light", "on")),
        *(switch("turn_off", "", "on"), switch("unplug", "", "on"), switch("shut", "closed", "open")),
    )
)


def switch_events(*calls: str) -> tuple[Event, ...]:
    parts = [call.partition(" ") for call in calls]
    return tuple(Event(kind, thing) for kind, _, thing in parts)


@pytest.mark.parametrize(
    ("calls", "expected"),
    [
        ([], False),
        (["turn_on stove"], True),
        (["light stove"], True),
        (["turn_on oven"], False),
        (["turn_on stove", "turn_off stove"], False),
        (["turn_on stove", "unplug stove"], False),
        (["turn_on stove", "turn_off oven"], True),
        (["turn_on stove", "unplug stove", "turn_off stove", "light stove"], True),
        (["unplug stove", "turn_on stove", "turn_off stove"], False),
    ],
)
def test_last_skill_that_changes_a_state_decides(calls: list[str], expected: bool) -> None:  # noqa: FBT001 - a row of a table
    formula = parse('on("stove")', skills=SWITCHES)
    assert holds(formula, switch_events(*calls)) is expected
    assert holds(parse('not on("stove")', skills=SWITCHES), switch_events(*calls)) is not expected
    assert parse(str(formula), skills=SWITCHES) == formula


def test_state_of_a_set_holds_if_it_holds_for_any_name() -> None:
    formula = parse('on("{hot}")', skills=SWITCHES, sets={"hot": ["stove", "oven (big)"]})
    assert holds(formula, switch_events("turn_on stove", "turn_on oven (big)", "turn_off oven (big)"))
    assert holds(formula, switch_events("turn_on oven (big)", "turn_off stove"))
    assert not holds(formula, switch_events("turn_on stove", "turn_off stove", "turn_on oven"))


@pytest.mark.parametrize(
    ("text", "column", "named"),
    [
        ('on("stove|oven")', 4, "names one thing"),
        ('on(words("stove"))', 4, "names one thing"),
        ('on("")', 4, "names one thing"),
        ("on()", 1, "1 argument"),
        ('onn("stove")', 1, "did you mean on?"),
        ('open("stove")', 1, "unknown state open"),
        ('tr.Exists(on("stove"))', 11, "unknown element on"),
        ('last_found("a", "b")', 1, "1 argument"),
        ('found("a")', 1, "expected a test"),
    ],
)
def test_wrong_states_and_looks_are_errors(text: str, column: int, named: str) -> None:
    with pytest.raises(RtlSyntaxError) as caught:
        parse(text, skills=SWITCHES)
    assert caught.value.column == column
    assert named in caught.value.problem


def test_errors_and_formulas_can_be_pickled() -> None:
    with pytest.raises(RtlSyntaxError) as caught:
        parse("tr")
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    formula = parse('tr.ActAtSome("a", say("b"))')
    holds(formula, (Event("goto", "a"),))
    assert pickle.loads(pickle.dumps(formula)) == formula


@pytest.mark.parametrize(
    "text",
    [
        'not tr.Exists(inside("lab"))',
        'tr.BeforeLast(inside(without("lab"))).Last(inside("hall"))',
        'not tr.Exists(holding("glass", inside("lab")))',
    ],
)
def test_only_house_rules_may_use_the_pose_of_the_robot(text: str) -> None:
    formula = parse(text, skills=SKILLS.with_skill(POSE_IN_ROOM))
    assert str(formula) == text
    assert parse(str(formula), skills=SKILLS.with_skill(POSE_IN_ROOM)) == formula
    with pytest.raises(RtlSyntaxError, match="only house rules"):
        parse(text)


@pytest.mark.parametrize("wrong", ['returned(True, inside("a"))', 'to("a", inside("b"))', 'inside("a", "b")'])
def test_pose_with_a_result_an_addressee_or_two_rooms_is_refused(wrong: str) -> None:
    with pytest.raises(RtlSyntaxError):
        parse(f"tr.Exists({wrong})", skills=SKILLS.with_skill(POSE_IN_ROOM))
