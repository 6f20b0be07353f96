"""Rules that programs could evade: by other names of a room, or inside custom skills."""

from __future__ import annotations

from pathlib import Path

import pytest

from codebotler.checking.house_rules.rooms import find_evasions
from codebotler.core.errors import UserError
from codebotler.core.skills.files import skills_from
from codebotler.core.skills.paper import SKILLS
from codebotler.rtl import parse
from codebotler.simulator.guard.house_rule import Rule

BOTH = "bob's office|accounting"


def rule(formula: str, name: str = "bob") -> Rule:
    return Rule(name, "Keep out.", parse(formula))


# --- rooms


@pytest.mark.parametrize(
    ("formula", "room"),
    [
        ('not tr.Exists(goto("^bob\'s office$"))', BOTH),
        ('not tr.Exists(goto("^(bob\'s office|accounting)$"))', BOTH),
        ('not tr.Exists(goto("accounting$|^bob\'s office$"))', "(bob's office|accounting)"),
        ('not tr.Exists(at("^accounting$", say(".*")))', BOTH),
        ('not tr.Exists(goto("^lab 3$"))', "lab [0-9]"),
        ('not tr.OnlyAfterLast(goto("^lab 3$")).Exists(pick(".*"))', "lab [0-9]"),
        ('not tr.Last(goto(".*")) or tr.Last(goto(words("^accounting$")))', BOTH),
        ('not tr.ActAtSome("^accounting$", say(".*"))', BOTH),
    ],
)
def test_anchor_that_other_names_of_the_room_evade_is_refused(formula: str, room: str) -> None:
    with pytest.raises(UserError) as caught:
        list(find_evasions([rule(formula)], ["hall", room], SKILLS))
    assert '"bob"' in caught.value.sentence
    assert room in caught.value.sentence


@pytest.mark.parametrize(
    ("formula", "room"),
    [
        ('not tr.Exists(goto("^hall$"))', BOTH),
        ('not tr.Exists(goto("^bob\'s office$"))', "bob's office"),
        ('not tr.Exists(goto("^lab$"))', "^lab$"),
        ('not tr.Exists(goto(r"\\b(bob\'s office|accounting)\\b"))', BOTH),
        ('not tr.Exists(goto("acme inc."))', "acme inc."),
        ('not tr.Exists(goto("^.*$"))', BOTH),
        ('not tr.Exists(goto(".*"))', "lab [0-9]"),
        ('not tr.Exists(say("^accounting$"))', BOTH),
    ],
)
def test_formula_that_no_name_evades_is_accepted(formula: str, room: str) -> None:
    assert list(find_evasions([rule(formula)], ["hall", room], SKILLS)) == []


@pytest.mark.parametrize(
    ("formula", "room"),
    [
        ('not tr.Exists(goto("bob\'s office"))', BOTH),
        ('not tr.Exists(at(r"\\bbob\'s office\\b", say(".*")))', BOTH),
        ('not tr.Exists(goto("acme inc[.]"))', "acme inc."),
        ('not tr.Exists(goto("0-9"))', "lab [0-9]"),
        ('not tr.Exists(goto("lab 3"))', "lab [0-9]"),
        ('not tr.Exists(at("bob\'s office", say(".*")))', "(bob's|robert's) office"),
    ],
)
def test_rule_that_names_a_part_of_the_regex_is_refused(formula: str, room: str) -> None:
    """The event holds the words of the request, so a part of the regex would miss the other words."""
    with pytest.raises(UserError) as caught:
        list(find_evasions([rule(formula)], ["hall", room], SKILLS))
    assert room in caught.value.sentence


# --- skills

HEAD = "from codebotler import Simulation, skill\n"
DRIVING_TOUR = 'def tour(sim: Simulation, room: str) -> None:\n    "Tour."\n    sim.drive(room)\n'
RANDOM_TOUR = "def tour(sim: Simulation, room: str) -> None: 'Tour.'\n"
NO_VAULT = 'not tr.Exists(goto("vault"))'


@pytest.mark.parametrize(
    ("code", "formulas", "is_reported"),
    [
        ("@skill\n" + DRIVING_TOUR, [NO_VAULT], True),
        ("@skill\n" + DRIVING_TOUR, [f'{NO_VAULT} and not tr.Exists(tour("vault"))'], False),
        ("@skill\n" + DRIVING_TOUR, [NO_VAULT, 'not tr.AtLeast(tour(".*"), 4)'], False),
        ("@skill\n" + DRIVING_TOUR, [], False),
        ("@skill(event=None)\n" + DRIVING_TOUR, [NO_VAULT], True),
        ("@skill\n" + RANDOM_TOUR, [NO_VAULT], False),
        ("@skill(names='room')\n" + RANDOM_TOUR, [NO_VAULT], True),
    ],
)
def test_own_skill_that_may_do_what_rules_forbid_is_reported(
    tmp_path: Path, code: str, formulas: list[str], *, is_reported: bool
) -> None:
    (tmp_path / "own.py").write_text(HEAD + code)
    skills = skills_from(tmp_path / "own.py")
    rules = [Rule(f"r{n}", "So it is.", parse(text, skills=skills)) for n, text in enumerate(formulas)]
    warnings = list(find_evasions(rules, (), skills))
    assert len(warnings) == is_reported
    assert all(" tour " in sentence for sentence in warnings)


def test_room_that_requests_reach_before_one_with_a_regex_may_be_named_with_anchors() -> None:
    rooms = ["hall", "lab 1", "lab|workshop"]
    assert list(find_evasions([rule('not tr.Exists(goto("^lab 1$"))')], rooms, SKILLS)) == []
