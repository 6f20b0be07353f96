"""Tasks to train on: right programs earn 1, others less, and nothing that is measured with is among them."""

from __future__ import annotations

import ast
import re

import pytest

from codebotler.core.errors import UserError
from hacking import earned, hacks, honest
from roboeval.suites.load import load_suite, shipped_suites
from roboeval.suites.solutions import solutions
from roboeval.training.families import family_names, trained_task
from roboeval.training.rollouts import Rollout, judge

SEEDS = (0, 1, 1_000_000_000)
IDLE = ("", "def task_program():\n    pass\n")
MEASURED = [(suite, task) for suite in shipped_suites() for task in load_suite(suite).tasks.values()]
ALIKE = 8  # words in a row that two instructions may not share


def test_there_are_families_enough() -> None:
    assert len(family_names()) >= 16


@pytest.mark.parametrize("family", family_names())
@pytest.mark.parametrize("seed", SEEDS)
def test_right_programs_earn_1_idle_ones_0_and_wrong_ones_something_between(family: str, seed: int) -> None:
    task = trained_task(family, seed)
    programs = (task.solution, *IDLE, *(one.program for one in task.wrong))
    numbers = range(len(task.prompts))
    assert len(numbers) >= 4
    for prompt in numbers:
        found = judge([Rollout(family, seed, prompt, program) for program in programs])
        right, nothing, idle, *wrong = (one.reward for one in found)
        assert (right, nothing, idle) == (1, 0, 0), prompt
        assert max(wrong) < 1, prompt


@pytest.mark.parametrize("family", family_names())
def test_a_seed_always_makes_the_same_task_and_another_one_another(family: str) -> None:
    task, again, other = trained_task(family, 5), trained_task(family, 5, worlds=8), trained_task(family, 6)
    assert task == again
    assert task.suite.digest != other.suite.digest
    assert task.prompts != other.prompts
    scenarios = task.suite.tasks[task.name].scenarios
    assert len(scenarios) >= 8
    assert not any("{" in prompt or "$" in prompt for prompt in task.prompts)


def test_worlds_are_as_many_as_asked_for() -> None:
    task = trained_task("BringThing", 3, worlds=40)
    assert len(task.suite.tasks[task.name].scenarios) >= 40


# --- nothing that is measured with is learned


def shingles(text: str) -> set[tuple[str, ...]]:
    words = re.findall(r"[a-z']+", text.lower())
    return {tuple(words[at : at + ALIKE]) for at in range(len(words) - ALIKE + 1)}


def shape(program: str) -> str:
    """A program without its texts and names."""
    tree = ast.parse(program)
    for node in ast.walk(tree):
        match node:
            case ast.Constant(str()):
                node.value = ""
            case ast.Name():
                node.id = "x"
    return ast.dump(tree)


@pytest.mark.parametrize("family", family_names())
def test_no_instruction_is_one_that_is_measured_with(family: str) -> None:
    asked = {words for _, task in MEASURED for prompt in task.prompts for words in shingles(prompt)}
    for seed in SEEDS:
        for prompt in trained_task(family, seed).prompts:
            assert not shingles(prompt) & asked


@pytest.mark.parametrize("family", family_names())
def test_no_solution_is_one_of_a_task_that_is_measured_with(family: str) -> None:
    known = {shape(one.program) for _, task in MEASURED for one in solutions(task) if one.fails is None}
    assert known
    assert shape(trained_task(family, 0).solution) not in known


# --- what cannot be gained


def test_no_hack_earns_as_much_as_an_honest_program_without_its_last_step() -> None:
    programs = hacks()
    assert len(programs) >= 30
    aim = honest(SEEDS[:1])
    assert aim > 0.3
    assert {about: reward for about, reward in earned(programs, SEEDS[:1]).items() if reward >= aim} == {}


# --- mistakes


def test_an_unknown_family_is_refused() -> None:
    with pytest.raises(UserError, match='there is no family "Fly"; there is AnnounceInOrder'):
        trained_task("Fly", 1)
