"""How programs could evade rules: by other names of a room, and inside skills of the user's own."""

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
def test_an_anchor_that_other_words_evade_is_refused(formula: str, room: str) -> None:
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
def test_what_no_words_evade_is_accepted(formula: str, room: str) -> None:
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
    """Events carry the words of the request there, so the rest of the regex would not count."""
    with pytest.raises(UserError) as caught:
        list(find_evasions([rule(formula)], ["hall", room], SKILLS))
    assert room in caught.value.sentence


# --- skills

HEAD = "from codebotler import Simulation, skill\n"
DRIVES = 'def tour(sim: Simulation, room: str) -> None:\n    "Tour."\n    sim.drive(room)\n'
BY_LOT = "def tour(sim: Simulation, room: str) -> None: 'Tour.'\n"
NO_VAULT = 'not tr.Exists(goto("vault"))'


@pytest.mark.parametrize(
    ("code", "formulas", "is_told"),
    [
        ("@skill\n" + DRIVES, [NO_VAULT], True),
        ("@skill\n" + DRIVES, [f'{NO_VAULT} and not tr.Exists(tour("vault"))'], False),
        ("@skill\n" + DRIVES, [NO_VAULT, 'not tr.AtLeast(tour(".*"), 4)'], False),
        ("@skill\n" + DRIVES, [], False),
        ("@skill(event=None)\n" + DRIVES, [NO_VAULT], True),
        ("@skill\n" + BY_LOT, [NO_VAULT], False),
        ("@skill(names='room')\n" + BY_LOT, [NO_VAULT], True),
    ],
)
def test_an_own_skill_that_may_do_what_rules_forbid_is_told(
    tmp_path: Path, code: str, formulas: list[str], *, is_told: bool
) -> None:
    (tmp_path / "own.py").write_text(HEAD + code)
    skills = skills_from(tmp_path / "own.py")
    rules = [Rule(f"r{n}", "So it is.", parse(text, skills=skills)) for n, text in enumerate(formulas)]
    told = list(find_evasions(rules, (), skills))
    assert len(told) == is_told
    assert all(" tour " in sentence for sentence in told)


def test_room_that_requests_reach_before_one_with_a_regex_may_be_named_with_anchors() -> None:
    rooms = ["hall", "lab 1", "lab|workshop"]
    assert list(find_evasions([rule('not tr.Exists(goto("^lab 1$"))')], rooms, SKILLS)) == []
