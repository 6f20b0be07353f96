"""The 16 tasks: five phrasings each, all facts for the requirements, and recorded programs."""

import ast
import re
from collections.abc import Iterator
from itertools import chain, combinations
from typing import Any

import pytest

from codebotler.models.recorded import Solution, open_recorded
from roboeval.evaluation.judging.failures import AGENT_ERROR_CLASS, FAILURE_CLASSES, NO_PROGRAM_CLASS
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.source import recorded_completions
from roboeval.suites.load import Suite, Task, load_suite

TASKS = list(load_suite("paper").tasks.values())
MODELS = ("careful", "hasty")

each_task = pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
each_model = pytest.mark.parametrize("model", MODELS)


def test_the_suite_has_the_tasks_of_the_paper(paper: Suite) -> None:
    assert len(paper.tasks) == 16
    assert sum(len(task.scenarios) for task in paper.tasks.values()) == 52
    ablated = {name for name, task in paper.tasks.items() if task.ablation is not None}
    assert ablated == {"CountSavory", "GrilledCheese", "LunchTime", "SetTemperature"}


@each_task
def test_five_phrasings_differ(task: Task) -> None:
    assert len(task.prompts) == 5
    for one, other in combinations(task.prompts, 2):
        mine, theirs = set(one.lower().split()), set(other.lower().split())
        assert len(mine & theirs) / len(mine | theirs) < 0.7


@each_task
def test_every_prompt_has_the_facts_of_the_requirements(task: Task) -> None:
    assert task.facts
    for fact in task.facts:
        for prompt in task.prompts:
            found = any(re.search(word, prompt, re.IGNORECASE) for word in fact.words)
            assert found != fact.commonsense, (fact.fact, prompt)


@each_task
def test_no_prompt_names_the_start_or_a_skill(task: Task) -> None:
    for prompt in task.prompts:
        assert not re.search(r"start_loc|go_to|is_in_room|get_all|python|function", prompt, re.IGNORECASE)


def test_tasks_of_common_sense_list_it(paper: Suite) -> None:
    for task in paper.tasks.values():
        if task.ablation is not None:
            assert any(fact.commonsense for fact in task.facts), task.name


def shape(program: str) -> str:
    """Return the structure of a program, without its names and literals."""
    try:
        tree = ast.parse(program)
    except SyntaxError:
        return re.sub(r"\w+", "x", program)
    for node in ast.walk(tree):
        for field, value in ast.iter_fields(node):
            if field in ("id", "name", "arg", "attr", "kind", "type_comment"):
                setattr(node, field, "x")
            elif field == "value" and isinstance(node, ast.Constant):
                setattr(node, field, type(value).__name__)
    return ast.dump(tree)


@each_task
@each_model
def test_programs_for_different_prompts_have_different_structures(task: Task, model: str) -> None:
    replies = open_recorded(f"recorded:{model}").replies
    shapes = [frozenset(shape(reply.program) for reply in replies[prompt]) for prompt in task.prompts]
    differing = max(
        len(group)
        for size in range(1, 6)
        for group in combinations(range(5), size)
        if all(not shapes[a] & shapes[b] for a, b in combinations(group, 2))
    )
    assert differing >= 4


@each_model
def test_every_prompt_has_recorded_programs(paper: Suite, model: str) -> None:
    replies = open_recorded(f"recorded:{model}").replies
    prompts = {prompt for task in paper.tasks.values() for prompt in task.prompts}
    assert prompts <= set(replies)
    assert len(prompts) == 80
    assert all(len(replies[prompt]) >= (1 if model == "careful" else 2) for prompt in prompts)


@pytest.fixture(scope="session")
def verdicts(paper: Suite) -> dict[str, list[tuple[Completion, Solution, dict[str, Any]]]]:
    def judge_recorded(model: str) -> Iterator[tuple[Completion, Solution, dict[str, Any]]]:
        completions = list(recorded_completions(f"recorded:{model}", paper))
        replies = open_recorded(f"recorded:{model}")
        for completion, row in zip(completions, evaluate(completions, paper, workers=2), strict=True):
            assert completion.instruction is not None
            yield completion, replies.solution(completion.instruction, completion.index), {**row}

    return {model: list(judge_recorded(model)) for model in MODELS}


Verdicts = dict[str, list[tuple[Completion, Solution, dict[str, Any]]]]


# No test of verdicts has a parameter, so one process judges for all.


def test_recorded_programs_fail_as_they_say(verdicts: Verdicts) -> None:
    for completion, reply, row in chain.from_iterable(verdicts.values()):
        kind = None if row["failure"] is None else row["failure"]["kind"]
        assert kind == reply.fails, (completion.key, row["failure"])


def test_the_reference_programs_pass(verdicts: Verdicts) -> None:
    first = [row for completion, _, row in verdicts["careful"] if completion.key[1:] == (0, 0)]
    assert len(first) == 16
    assert all(row["passed"] for row in first)


def test_careful_passes_most_and_hasty_fails_in_every_way(verdicts: Verdicts) -> None:
    careful = [row["passed"] for _, _, row in verdicts["careful"]]
    assert sum(careful) / len(careful) > 0.8
    failures = [row["failure"] for _, _, row in verdicts["hasty"] if not row["passed"]]
    without_programs = {NO_PROGRAM_CLASS, AGENT_ERROR_CLASS}
    assert {failure["class"] for failure in failures} == {*FAILURE_CLASSES} - without_programs
    assert len({failure["kind"] for failure in failures}) >= 12


def test_a_task_has_programs_that_fail_for_four_reasons(verdicts: Verdicts) -> None:
    reasons: dict[str, set[tuple[str, str | None]]] = {task.name: set() for task in TASKS}
    for completion, _, row in chain.from_iterable(verdicts.values()):
        if not row["passed"]:
            reasons[completion.task].add((row["failure"]["kind"], row["failure"]["check"]))
    assert {task: found for task, found in reasons.items() if len(found) < 4} == {}
