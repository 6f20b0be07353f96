"""Reviews of house rules: correct examples, and warnings of likely mistakes."""

from __future__ import annotations

import pytest
from rich.console import Console

from codebotler.checking.house_rules.review import (
    ALWAYS_BROKEN,
    DETECTED,
    IMPOSSIBLE,
    NEVER_BROKEN,
    review_rules,
)
from codebotler.cli.programs.rules import step_sentence, steps_view
from codebotler.core.trace import Event, Option, Trace
from codebotler.core.world import Person, Room, World
from codebotler.rtl import Monitor, holds, parse
from codebotler.simulator.guard.house_rule import Rule

WORLD = World(
    (Room("hall"), Room("kitchen", ("glass",)), Room("office", (), (Person("carol"),))),
    "hall",
)
NO_VAULT = 'not tr.Exists(goto("vault"))'
NO_OFFICE = 'not tr.Exists(goto("office"))'
KNOCK = (
    'not tr.Last(goto("office")) or tr.BeforeLast(goto("office")).AfterLast(goto(".*")).Exists(say("knock"))'
)
FORBIDS_EVERYTHING = " and ".join(
    f'not tr.Exists({kind}(".*"))' for kind in ("goto", "say", "check", "pick", "place", "mention")
)
FORMULAS = (
    NO_OFFICE,
    KNOCK,
    'not tr.AtLeast(goto("kitchen"), 2)',
    'not tr.Exists(at("kitchen", holding("glass", goto(without("kitchen")))))',
    'not tr.Exists(to("carol", ask(".*", ".*")))',
    'not tr.Exists(holding(".*", goto("kitchen")))',
    'not tr.Exists(at("hall", holding(without("mug"), goto(".*"))))',
    'not tr.Exists(missed("glass"))',
    'not tr.OnlyAfterLast(missed("glass")).Exists(say(".*"))',
    'not tr.Last(say("done")) or tr.OnlyAfterLast(goto("kitchen")).Exists(found("glass"))',
)


def rules(*formulas: str, when: str = "always") -> list[Rule]:
    return [
        Rule(f"r{n}", "A rule.", parse(text), "always" if when == "always" else "finally")
        for n, text in enumerate(formulas)
    ]


@pytest.mark.parametrize("world", [None, WORLD], ids=["anywhere", "in a world"])
@pytest.mark.parametrize("text", FORMULAS)
def test_examples_keep_and_break_the_rule(text: str, world: World | None) -> None:
    (review,) = review_rules(rules(text), world)
    formula = parse(text)
    assert review.keeps
    assert all(holds(formula, review.keeps[:end]) for end in range(len(review.keeps) + 1))
    assert review.breaks
    assert not holds(formula, review.breaks)
    assert all(holds(formula, review.breaks[:end]) for end in range(len(review.breaks)))
    assert set(review.warnings) <= {DETECTED}


def test_example_that_keeps_a_conditional_rule_meets_its_condition() -> None:
    (review,) = review_rules(rules(KNOCK), WORLD)
    assert review.keeps is not None
    assert [(event.kind, event.text) for event in review.keeps] == [("say", "knock"), ("goto", "office")]


def test_robot_of_an_example_picks_up_the_thing_that_it_holds() -> None:
    (review,) = review_rules(
        rules('not tr.Exists(at("kitchen", holding("glass", goto(without("kitchen")))))'), WORLD
    )
    assert review.breaks is not None
    assert [(event.kind, event.text) for event in review.breaks[:2]] == [
        ("goto", "kitchen"),
        ("pick", "glass"),
    ]
    assert review.breaks[2].holding == "glass"
    (impossible,) = review_rules(
        rules('tr.Exists(pick("mug")) or not tr.Exists(holding("mug", say(".*")))'), WORLD
    )
    assert NEVER_BROKEN in impossible.warnings
    (anything,) = review_rules(rules('not tr.Exists(holding(".*", goto("kitchen")))'), WORLD)
    assert anything.breaks is not None
    assert [event.kind for event in anything.breaks] == ["pick", "goto"]


def test_examples_use_the_rooms_of_the_world() -> None:
    (review,) = review_rules(rules('not tr.Exists(at("kitchen", say("hush")))'), WORLD)
    assert review.breaks is not None
    assert [(event.kind, event.text, event.place) for event in review.breaks] == [
        ("goto", "kitchen", ""),
        ("say", "hush", "kitchen"),
    ]


@pytest.mark.parametrize(
    ("text", "when", "warning"),
    [
        ('tr.AtLeast(goto("hall"), 0)', "always", NEVER_BROKEN),
        ('not tr.Exists(goto("hall")) or tr.Exists(goto("hall"))', "always", NEVER_BROKEN),
        (FORBIDS_EVERYTHING, "always", ALWAYS_BROKEN),
        ('tr.Exists(goto("hall")) and not tr.Exists(goto("hall"))', "finally", IMPOSSIBLE),
        ('not tr.Exists(missed("glass"))', "always", DETECTED),
        ('not tr.Exists(answered("yes"))', "always", DETECTED),
        ('not tr.Exists(found("mug")) or not tr.Exists(goto("kitchen"))', "always", DETECTED),
    ],
)
def test_suspicious_rule_has_a_warning(text: str, when: str, warning: str) -> None:
    (review,) = review_rules(rules(text, when=when))
    assert warning in review.warnings


@pytest.mark.parametrize("text", ['not tr.Exists(answered(".*"))', NO_OFFICE, 'not tr.Exists(check("mug"))'])
def test_preventable_rule_has_no_warning(text: str) -> None:
    (review,) = review_rules(rules(text))
    assert review.warnings == ()


@pytest.mark.parametrize(
    "text",
    [
        'not tr.Exists(at("kitchen", holding("glass", goto(without("kitchen")))))',
        'not tr.Last(goto("lab 2")) or tr.Exists(at("lab 1", goto(".*")))',
    ],
)
def test_examples_name_the_start_of_a_drive_that_decides(text: str) -> None:
    (review,) = review_rules(rules(text))
    assert review.keeps
    assert review.breaks
    assert steps(review.keeps) != steps(review.breaks)


def steps(trace: Trace) -> str:
    shown = Console(width=200)
    with shown.capture() as captured:
        shown.print(steps_view(trace))
    return captured.get()


def test_name_that_the_world_lacks_has_a_warning() -> None:
    texts = (
        NO_VAULT,
        'not tr.Exists(at("cellar", say(".*")))',
        'not tr.Exists(pick("crown"))',
        'not tr.Exists(holding("crown", goto("hall")))',
        'not tr.Exists(to("bob", ask(".*", ".*")))',
        'not tr.Exists(found("crown"))',
    )
    named = ('"vault"', '"cellar"', '"crown"', '"crown"', '"bob"', '"crown"')
    for text, name in zip(texts, named, strict=True):
        (review,) = review_rules(rules(text), WORLD)
        assert any(name in warning for warning in review.warnings), text
        (known,) = review_rules(rules('not tr.Exists(holding(".", goto("hall")))'), WORLD)
        assert not known.warnings
        (anywhere,) = review_rules(rules(text))
        assert not any("world" in warning for warning in anywhere.warnings)


@pytest.mark.parametrize(
    ("one", "other", "warnings"),
    [
        (
            'not tr.AtLeast(goto("hall"), 2)',
            'not tr.AtLeast(goto("hall"), 3)',
            ["", 'this rule follows from "r0"'],
        ),
        (
            'not tr.AtLeast(goto("hall"), 3)',
            'not tr.AtLeast(goto("hall"), 2)',
            ['this rule follows from "r1"', ""],
        ),
        (NO_OFFICE, 'tr.Count(goto("office"), 0)', ["", 'this rule is equivalent to "r0"']),
        (NO_OFFICE, KNOCK, ["", 'this rule follows from "r0"']),
        (NO_OFFICE, 'not tr.Exists(say("hush"))', ["", ""]),
    ],
)
def test_redundant_rules_have_a_warning(one: str, other: str, warnings: list[str]) -> None:
    found = review_rules(rules(one, other))
    assert [next(iter(review.warnings), "") for review in found] == warnings


def test_contradictory_rules_have_a_warning() -> None:
    (always,) = rules(NO_OFFICE)
    (end,) = rules('tr.Exists(goto("office"))', when="finally")
    _, review = review_rules([always, Rule("end", "Go there.", end.formula, "finally")])
    assert review.warnings == ('this rule cannot be kept together with "r0"',)
    several = rules('tr.Exists(say("a"))', 'not tr.Exists(say("a"))', when="finally")
    assert review_rules(several)[1].warnings == ('this rule cannot be kept together with "r0"',)


def test_step_sentence_shows_everything_that_rules_compare() -> None:
    asked = Event("ask", "x", (Option("tea"),), "tea", place="hall", holding="mug", to="carol")
    sentence = 'asks "…" [tea] of "carol" in hall holding "mug" and hears "tea"'
    assert step_sentence(asked) == sentence
    assert step_sentence(Event("check", "mug", found=False)) == 'looks for "mug": not found'
    assert step_sentence(Event("goto", "")) == 'drives to "…"'


def leaving_rule(name: str, formula: str) -> Rule:
    return Rule(name, "Leave it so.", parse(formula), "leaving")


LOCKED = 'not tr.AfterLast(place("glass")).Exists(pick("glass"))'


@pytest.mark.parametrize("world", [None, WORLD], ids=["anywhere", "in a world"])
def test_examples_of_a_leaving_rule_show_the_end(world: World | None) -> None:
    (review,) = review_rules([leaving_rule("locked", LOCKED)], world)
    assert review.keeps is not None
    assert review.breaks is not None
    assert [event.kind for event in review.keeps] == ["pick", "place"]
    assert [event.kind for event in review.breaks] == ["pick"]
    assert review.warnings == ()


@pytest.mark.parametrize(
    ("when", "warnings"),
    [
        ("always", ["", 'this rule follows from "r0"']),
        ("leaving", ["", 'this rule is equivalent to "r0"']),
        ("finally", ['this rule follows from "leave"', ""]),
    ],
)
def test_leaving_rules_are_compared_with_others(when: str, warnings: list[str]) -> None:
    (other,) = rules(LOCKED, when=when)
    other = leaving_rule("r0", LOCKED) if when == "leaving" else other
    found = review_rules([other, leaving_rule("leave", LOCKED)])
    assert [next(iter(review.warnings), "") for review in found] == warnings


def test_leaving_rule_that_contradicts_another_has_a_warning() -> None:
    (silent,) = rules('not tr.Exists(say(".*"))')
    found = review_rules([silent, leaving_rule("bye", 'tr.Exists(say("bye"))')])
    assert found[1].warnings == ('this rule cannot be kept together with "r0"',)
    (review,) = review_rules([leaving_rule("never", 'tr.Exists(say("a")) and not tr.Exists(say("a"))')])
    assert IMPOSSIBLE in review.warnings


def test_the_monitor_agrees_with_every_example() -> None:
    for review in review_rules(rules(*FORMULAS), WORLD):
        monitor = Monitor(review.rule.formula)
        assert review.breaks is not None
        assert [monitor.feed(event) for event in review.breaks][-1] is False


@pytest.mark.parametrize(
    ("formula", "breaks"),
    [
        ('not tr.Exists(goto("^lab 1$"))', [("lab 1", "")]),
        ('not tr.Exists(goto(".12."))', [("lab [12]", "")]),
        ('not tr.Exists(at("lab 2", goto("hall")))', [("lab 2", "hall"), ("hall", "lab 2")]),
    ],
)
def test_examples_use_words_that_match_the_regex_of_a_room(
    formula: str, breaks: list[tuple[str, str]]
) -> None:
    world = World((Room("hall"), Room("lab [12]"), Room("acme inc.")), "hall")
    (review,) = review_rules([Rule("lab", "Keep out.", parse(formula))], world)
    assert review.breaks is not None
    assert [(event.text, event.place) for event in review.breaks] == breaks
