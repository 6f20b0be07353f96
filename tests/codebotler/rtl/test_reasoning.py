"""Reasoning about formulas: satisfiability, implication, conflicts, and traces that tell them apart."""

from collections.abc import Callable
from itertools import product
from typing import get_args

import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from codebotler.core.trace import Event, Option, Trace
from codebotler.rtl import And, Formula, Not, Regex, Without, Words, holds, parse
from codebotler.rtl.formulas import EventPattern, ScopeName
from codebotler.rtl.reasoning import (
    Reasoner,
    Undecided,
    conflict,
    distinguishing_trace,
    is_implied,
    is_satisfiable,
    samples,
    satisfying_trace,
)
from codebotler.rtl.reasoning.alphabet import aspects_of
from codebotler.rtl.reasoning.automaton import Automaton
from codebotler.rtl.reasoning.sample_strings import can_match, distinct_strings
from codebotler.rtl.semantics import is_match

SPEAKS, GOES, STAYS = map(
    parse, ('tr.Exists(say("hello"))', 'tr.Exists(goto("kitchen"))', 'not tr.Exists(goto("kitchen"))')
)
GREETS_THERE = parse('tr.ActAtFirst("kitchen", say("hello"))')
TOO_LARGE = parse('tr.Count(say("a"), 5000)')


A, B = Regex("a"), Regex("b")


@pytest.mark.parametrize(
    "element",
    [
        EventPattern("ask", A),
        EventPattern("ask", A, B),
        EventPattern("ask", A, mention=True),
        EventPattern("ask", A, place="a"),
        EventPattern("ask", A, answer=A),
        EventPattern("ask", A, found=True),
        EventPattern("ask", A, holding=A),
        EventPattern("ask", A, to=A),
        EventPattern("ask", A, more=(A, B)),
        EventPattern("ask", A, A, place="b", answer=B, found=False, holding=B, to=B, more=(B,)),
    ],
    ids=str,
)
def test_element_matches_if_each_of_its_aspects_does(element: EventPattern) -> None:
    options, more = [(), (Option("a"),), (Option("b"), Option("a"))], [(), ("a", "b"), ("b",)]
    found: set[bool] = set()
    for text, offered, answer, is_found, place, holding, to, further in product(
        "ab", options, (None, "a", "b"), (None, True, False), "ab", ("", "a", "b"), (None, "a", "b"), more
    ):
        event = Event("ask", text, offered, answer, is_found, place, 0.0, holding, to, further)
        matches = is_match(element, event, 0)
        found.add(matches)
        assert matches is all(is_match(one, event, 0) for one in aspects_of(element)), event
    assert found == {True, False}


# --- the questions


def test_satisfiable_formulas_have_a_shortest_trace() -> None:
    assert is_satisfiable(GREETS_THERE)
    assert satisfying_trace(GREETS_THERE) == (Event("goto", "kitchen"), Event("say", "hello"))
    both = satisfying_trace(parse('tr.Exists(say("tea"))'), parse('tr.Exists(say("ready"))'))
    assert both is not None
    assert len(both) == 1
    assert satisfying_trace(STAYS) == satisfying_trace() == ()


def test_contradictory_formulas_are_not_satisfiable() -> None:
    impossible = parse('tr.Exists(say("a")) and not tr.Exists(say("a|b"))')
    assert not is_satisfiable(impossible)
    assert not is_satisfiable(SPEAKS, GOES, STAYS)
    assert satisfying_trace(impossible) is None


X_ALONE = 'say(words("x", without("y")))'


@pytest.mark.parametrize(
    ("texts", "length"),
    [
        (['tr.Exists(say("y"))', 'tr.ActAtSome("a", say("x|y"))'], 2),
        ([f"tr.Exists({X_ALONE})", 'tr.Exists(say("x|y"))', 'tr.ActAtSome("a", say("x"))'], 2),
        (
            [
                f'tr.AfterLast(goto(without("a"))).AfterFirst(say("x")).Exists({X_ALONE})',
                f'tr.AfterLast({X_ALONE}).BeforeLast(say("y")).ActAtSome("a", say("x|y"))',
            ],
            5,
        ),
    ],
)
def test_shortest_trace_is_found_even_if_a_longer_one_comes_first(texts: list[str], length: int) -> None:
    formulas = [*map(parse, texts)]
    shortest, any_trace = satisfying_trace(*formulas), Reasoner(formulas).trace(formulas)
    assert shortest is not None
    assert any_trace is not None
    assert len(shortest) == length < len(any_trace)
    one, rest = formulas[-1], Not(parse(" and ".join(texts[:-1])))
    assert distinguishing_trace(one, And((one, rest))) == shortest


def test_conflict_names_the_formulas_that_contradict_each_other() -> None:
    assert conflict(SPEAKS, GOES, STAYS) == [GOES, STAYS]
    assert conflict(SPEAKS, GOES) is None


def test_implied_formulas_are_recognized() -> None:
    assert is_implied(GOES, GREETS_THERE)
    assert not is_implied(GREETS_THERE, GOES, SPEAKS)
    asks_first = parse('tr.AfterFirst(goto("kitchen")).BeforeFirst(say("hello")).Exists(ask("tea", ".*"))')
    asks_there = parse('tr.ActAtFirst("kitchen", ask("tea", ".*"))')
    assert is_implied(asks_there, GREETS_THERE, asks_first)
    assert not is_implied(asks_there, asks_first)
    assert is_implied(parse('tr.AtLeast(say("a"), 0)'))
    assert not is_implied(SPEAKS)


@pytest.mark.parametrize(
    ("one", "other", "length"),
    [
        ('tr.Exists(say("hello"))', 'not tr.Count(say("hello"), 0)', None),
        ('tr.Count(say("a"), 1)', 'tr.AtLeast(say("a"), 1) and not tr.AtLeast(say("a"), 2)', None),
        ('tr.Exists(say("a"))', 'tr.Count(say("a"), 1)', 2),
        ('tr.Count(say("a"), 1)', 'tr.Exists(say("a"))', 2),
        ('tr.ActAtFirst("^a$", say("x"))', 'tr.ActAtSome("^a$", say("x"))', 4),
        ('tr.Exists(say("no"))', r'tr.Exists(say(r"\bno\b"))', 1),
    ],
)
def test_shortest_trace_distinguishes_formulas_that_differ(one: str, other: str, length: int | None) -> None:
    first, second = parse(one), parse(other)
    trace = distinguishing_trace(first, second)
    assert (None if trace is None else len(trace)) == length
    assert trace is None or holds(first, trace) != holds(second, trace)


@pytest.mark.parametrize(
    "ask",
    [
        *(is_satisfiable, satisfying_trace, conflict, is_implied),
        lambda formula: distinguishing_trace(SPEAKS, formula),
    ],
)
def test_too_large_formula_is_undecided(ask: Callable[[Formula], object]) -> None:
    with pytest.raises(Undecided):
        ask(TOO_LARGE)


def test_a_large_product_is_undecided() -> None:
    many = [parse(f'tr.Count(say("^{letter}$"), 30)') for letter in "abc"]
    one_or_three = parse('tr.Count(say("d"), 1) or tr.Count(say("d"), 3)')
    assert is_satisfiable(*many, one_or_three)
    with pytest.raises(Undecided):
        is_satisfiable(*many, one_or_three, parse('tr.Count(say("d"), 0) or tr.Count(say("d"), 2)'))


# --- the rooms of one world


def test_moves_lead_only_to_rooms_of_the_world() -> None:
    lobby, there = parse('tr.Exists(goto("lobby"))'), parse('tr.Exists(at("office", say("x")))')
    moves = {"the kitchen": "kitchen", "office": "office"}
    at_home = Reasoner([lobby, there], moves, "kitchen")
    assert at_home.trace([lobby]) is None
    assert at_home.conflict([lobby]) == [lobby]
    assert at_home.trace([there], shortest=True) == (Event("goto", "office"), Event("say", "x"))
    assert Reasoner([there], moves, "office").trace([there], shortest=True) == (Event("say", "x"),)


# --- automata

SCOPES = (
    "",
    *(f".{name}({element})" for name in get_args(ScopeName) for element in ('goto("b")', 'say("x")')),
)
TESTS = (
    'Exists(say("x"))',
    'Count(say("x"), 2)',
    'AtLeast(say("x"), 2)',
    'ActAtFirst("a", say("x"))',
    'ActAtSome("a", say("x"))',
    'ActAtSome("a", goto("a"))',
    'Exists(ask("x", "y"))',
    'Last(say("x"))',
)


@pytest.mark.parametrize("scope", SCOPES)
@pytest.mark.parametrize("test", TESTS)
def test_automata_judge_all_short_traces_as_formulas_do(test: str, scope: str) -> None:
    formula = parse(f"tr{scope}.{test}")
    reasoner = Reasoner([formula], {move: move for move in ("a", "b", "xax", "a b")})
    automaton, letters = reasoner._reading(formula)
    events = {letter: event for event, letter in zip(reasoner.events, letters, strict=True)}
    length = 5 if len(events) < 5 else 4
    for word in product(events, repeat=length):
        state = 0
        for letter in word:
            state = automaton.rows[state][letter]
        assert automaton.accepts[state] == holds(formula, tuple(events[letter] for letter in word))
    assert automaton.accepts[0] == holds(formula, ())


@given(data=st.data())
def test_found_traces_and_conflicts_are_right(data: st.DataObject) -> None:
    formulas = data.draw(st.lists(FORMULAS, min_size=1, max_size=3, unique=True))
    denied = data.draw(FORMULAS)
    reasoner = Reasoner([*formulas, denied])
    try:
        found = reasoner.trace([*formulas, Not(denied)])
        shortest = reasoner.trace([*formulas, Not(denied)], shortest=True)
        found_conflict = reasoner.conflict(formulas, denied)
    except Undecided:
        reject()
    assert (found is None) == (shortest is None) == (found_conflict is not None)

    def is_right(trace: Trace) -> bool:
        return all(holds(one, trace) for one in formulas) and not holds(denied, trace)

    tried: Trace = tuple(data.draw(st.lists(st.sampled_from(reasoner.events), max_size=6)))
    if found is not None and shortest is not None:
        assert is_right(found)
        assert is_right(shortest)
        assert len(shortest) <= len(found)
        assert len(shortest) <= len(tried) or not is_right(tried)
    if found_conflict is not None and all(holds(one, tried) for one in found_conflict):
        assert holds(denied, tried)


def single_tests() -> st.SearchStrategy[str]:
    elements = st.sampled_from(
        [
            *(
                'goto("a")',
                'goto(without("a"))',
                'say("x|y")',
                'say(words("x", without("y")))',
                'ask("x", "y")',
            ),
            *('found("x")', 'missed("x")', 'holding("x", goto("a"))', 'to("x", ask(".*", "y"))'),
        ]
    )
    scope = st.builds("{}({})".format, st.sampled_from(get_args(ScopeName)), elements)
    scopes = st.lists(scope, max_size=2).map(lambda parts: ".".join(["tr", *parts]))
    counts = st.builds(
        "{}({}, {})".format, st.sampled_from(["Count", "AtLeast"]), elements, st.integers(0, 3)
    )
    acts = st.builds('{}("a", {})'.format, st.sampled_from(["ActAtFirst", "ActAtSome"]), elements)
    return st.builds(
        "{}.{}".format,
        scopes,
        st.one_of(elements.map("Exists({})".format), elements.map("Last({})".format), counts, acts),
    )


def formulas() -> st.SearchStrategy[Formula]:
    larger = st.builds(
        "({}) {} not ({})".format, single_tests(), st.sampled_from(["and", "or"]), single_tests()
    )
    return (single_tests() | larger | single_tests().map("not ({})".format)).map(parse)


FORMULAS = formulas()


def test_several_options_may_match_where_one_text_cannot() -> None:
    both = parse(
        'tr.Exists(ask("a", "^yes$")) and tr.Exists(ask("a", "^no$")) and tr.Count(ask("a", ".*"), 1)'
    )
    assert is_satisfiable(both)
    none = parse(
        'tr.Exists(ask("^yes$", ".*")) and tr.Exists(ask("^no$", ".*")) and tr.Count(ask(".*", ".*"), 1)'
    )
    assert not is_satisfiable(none)


def test_conflict_is_minimal() -> None:
    reasoner = Reasoner([GOES, STAYS, SPEAKS])
    assert reasoner.conflict([SPEAKS, GOES, STAYS]) == [GOES, STAYS]
    assert reasoner.conflict([SPEAKS, GOES], GOES) == [GOES]


def test_automata_are_small() -> None:
    formula = parse('tr.Exists(say("a")) and tr.Exists(say("a")) and tr.AtLeast(say("a"), 1)')
    automaton, _ = Reasoner([formula])._reading(formula)
    assert isinstance(automaton, Automaton)
    assert len(automaton.rows) == 2
    assert automaton.distances == (1, 0)


# --- sample strings


@pytest.mark.parametrize(
    "pattern",
    [
        "a|b",
        r"\bno\b",
        r"^4\b| 4",
        "a{2,3}",
        "[^a-z]",
        r"\d+:\S",
        "(?=.*6)(?=.*pm)",
        r"(a|b)\1",
        "[[a]b",
        "a{500}",
        "(?i:x)",
        "a(?!b)",
        r"\Bx",
    ],
)
def test_samples_match(pattern: str) -> None:
    found = samples(pattern)
    assert found
    for text in found:
        assert Regex(pattern).matches(text)
        assert text == text.strip()


def test_distinct_strings_match_in_all_combinations() -> None:
    texts = (Regex("cat"), Regex("dog|cow"), Without("cat"), Words((Regex("cat"), Regex("dog|cow"))))
    found = {tuple(text.matches(one) for text in texts[:3]) for one in distinct_strings(texts)}
    assert found == {
        (False, False, True),
        (True, False, False),
        (True, False, True),
        (False, True, True),
        (True, True, False),
        (True, True, True),
    }


def test_a_text_must_not_start_with_a_word() -> None:
    starts = (Regex("not"), Regex(r"^(?!not\b)"))
    found = {tuple(text.matches(one) for text in starts) for one in distinct_strings(starts)}
    assert found == {(False, True), (True, False), (True, True)}
    assert not can_match(Words((Regex("^x"), Regex(r"^(?!x)"))))
