"""Each example rule for a household stops its plan, and no plan that only looks like it."""

from __future__ import annotations

from pathlib import Path

import pytest

from codebotler.checking.house_rules.file import read_rules
from codebotler.checking.house_rules.review import review_rules
from codebotler.core.skills.files import skills_from
from codebotler.core.world_file import read_world
from codebotler.missions.rule_effects import find_program_effects

EXAMPLES = Path(__file__).parents[3] / "examples"
BROKEN = {
    "wet-electronics": "turn_on('toaster'); turn_off('lamp'); pour('water', 'toaster')",
    "microwave": "put('foil', 'plate'); put('plate', 'microwave')",
    "fire": "put('newspaper', 'stove'); turn_on('stove')",
    "turn-off": "turn_on('stove'); turn_on('oven'); turn_off('stove'); go_to('hall')",
    "child": "take('bread knife', 'drawer'); hand_over('bread knife', 'Mia')",
    "bleach": "pour('vinegar', 'bucket'); pour('bleach', 'bucket')",
    "floor": "take('apple', 'floor'); put('apple', 'kitchen table')",
    "heavy": "put('cast-iron pan', 'top shelf')",
    "doors": "open_door('fridge'); open_door('oven'); close_door('oven'); go_to('hall')",
    "oil": "pour('oil', 'pan'); turn_on('stove'); pour('water', 'pan')",
    "exit": "put('chair', 'doorway')",
    "look-first": "is_in_room('person'); go_to('bathroom'); pour('hot water', 'sink')",
}
KEPT = (
    "turn_on('lamp'); turn_off('lamp'); pour('water', 'vase beside the lamp')",
    "put('foil', 'plate'); take('foil', 'plate'); put('plate', 'microwave')",
    "open_door('oven'); close_door('oven'); turn_on('stove'); turn_off('stove'); go_to('hall')",
    "hand_over('bread knife', 'Tom'); hand_over('apple', 'Mia'); hand_over('pillow', 'Mia')",
    "pour('vinegar', 'bucket'); rinse('bucket'); pour('bleach', 'bucket')",
    "take('apple', 'floor'); put('apple', 'bin'); take('apple', 'fridge'); put('apple', 'table')",
    "pour('oil', 'pan'); turn_on('stove'); pour('water', 'pot'); turn_off('stove')",
    "go_to('bathroom'); is_in_room('person'); pour('hot water', 'sink')",
)


@pytest.mark.slow
def test_each_rule_stops_its_plan_before_the_step_and_no_near_miss() -> None:
    skills = skills_from(EXAMPLES / "skills" / "household.py")
    rules = read_rules(EXAMPLES / "rules" / "household.yaml", skills)
    world = read_world(EXAMPLES / "worlds" / "kitchen.yaml", skills)
    programs = [f"def task_program():\n    go_to('kitchen'); {body}\n" for body in (*BROKEN.values(), *KEPT)]
    effects = [(found.rule, found.when) for found in find_program_effects(programs, rules, world, skills)]
    assert effects == [*((rule, "before") for rule in BROKEN), *(("", "") for _ in KEPT)]
    assert [rule.name for rule in rules] == list(BROKEN)


@pytest.mark.slow
def test_a_review_of_each_household_rule_finds_examples_and_no_mistake() -> None:
    skills = skills_from(EXAMPLES / "skills" / "household.py")
    rules = read_rules(EXAMPLES / "rules" / "household.yaml", skills)
    world = read_world(EXAMPLES / "worlds" / "kitchen.yaml", skills)
    for rule in rules:  # All pairs would take half a minute.
        (review,) = review_rules([rule], world)
        assert not review.warnings
        assert review.keeps
        assert review.breaks
