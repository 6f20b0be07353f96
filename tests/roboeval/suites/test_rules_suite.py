"""The suite `rules`: its triples of tasks, its programs, and that each rule of its house matters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import pytest

from codebotler.models.recorded import Solution, open_recorded
from roboeval.evaluation.judging.judge import evaluate
from roboeval.evaluation.runs.completions import Completion
from roboeval.linting.lint import lint
from roboeval.linting.task_findings import judge_solutions
from roboeval.suites.load import Suite, Task, load_suite
from roboeval.suites.solutions import solutions

KINDS = ("Harmless", "Conflict", "Smuggled")
VIOLATION = "RuleViolation"


class Judged(NamedTuple):
    """A program for a task, and how it does with the rules of the house and without them."""

    task: str
    solution: Solution
    told: Mapping[str, Any]
    untold: Mapping[str, Any]

    @property
    def failure(self) -> str | None:
        """The kind of its failure."""
        return failure_of(self.told)

    @property
    def broken(self) -> set[str]:
        """The rules that it breaks in some world."""
        errors = (verdict["error"] for verdict in self.told["verdicts"])
        messages = [error["message"] for error in errors if error and error["kind"] == VIOLATION]
        return {match[1] for message in messages if (match := re.search(r'the rule "([^"]+)"', message))}


def failure_of(row: Mapping[str, Any]) -> str | None:
    """The kind of the failure that a row tells of."""
    return None if row["failure"] is None else str(row["failure"]["kind"])


@pytest.fixture(scope="module")
def suite() -> Suite:
    return load_suite("rules")


@pytest.fixture(scope="module")
def programs(suite: Suite) -> list[Judged]:
    listed = [(task.name, one) for task in suite.tasks.values() for one in solutions(task)]
    completions = [
        Completion(task=name, prompt=0, index=index, program=one.program)
        for index, (name, one) in enumerate(listed)
    ]
    told = evaluate(completions, suite, workers=2)
    untold = evaluate(completions, suite.with_house_rules(None), workers=2)
    rows = zip(listed, told, untold, strict=True)
    return [Judged(name, one, by_rules, without) for (name, one), by_rules, without in rows]


def test_tasks_come_in_triples(suite: Suite) -> None:
    families = {re.sub(f"({'|'.join(KINDS)})$", "", name) for name in suite.tasks}
    assert set(suite.tasks) == {family + kind for family in families for kind in KINDS}
    assert len(families) >= 14
    for task in suite.tasks.values():
        assert len(task.prompts) == 1
        assert 2 <= len(task.scenarios) <= 3


def test_the_instructions_of_a_triple_differ_little(suite: Suite) -> None:
    def words(task: Task) -> set[str]:
        return set(re.findall(r"\w+", task.prompts[0].lower()))

    for name in suite.tasks:
        if name.endswith("Harmless"):
            harmless = words(suite.tasks[name])
            for kind in KINDS[1:]:
                other = words(suite.tasks[name.replace("Harmless", kind)])
                assert len(harmless & other) >= 0.7 * len(harmless), (name, kind)


def test_models_are_told_ten_rules(suite: Suite) -> None:
    assert suite.house is not None
    assert len(suite.house_sentences) == len(suite.house.rules) == 10


def test_the_report_that_a_rule_asks_for_is_due_where_all_robots_start(suite: Suite) -> None:
    starts = {scenario.world.robot for task in suite.tasks.values() for scenario in task.scenarios}
    assert starts == {"start_loc"}


def test_programs_end_as_they_are_declared(programs: list[Judged]) -> None:
    assert [(one.task, one.solution.about, one.failure) for one in programs] == [
        (one.task, one.solution.about, one.solution.fails) for one in programs
    ]


def test_recorded_models_know_each_instruction(suite: Suite) -> None:
    for task in suite.tasks.values():
        careful, hasty = (
            open_recorded(f"recorded:{name}").replies[task.prompts[0]] for name in ("careful", "hasty")
        )
        assert all(one.fails is None for one in careful)
        assert all(one.fails is not None for one in hasty)


def test_careful_programs_break_no_rule_in_any_world(programs: list[Judged], suite: Suite) -> None:
    careful = [one for one in programs if one.solution.fails is None]
    assert {one.task for one in careful} == set(suite.tasks)
    for one in careful:
        assert all(verdict["satisfied"] and verdict["error"] is None for verdict in one.told["verdicts"])


@pytest.mark.parametrize("kind", ["Conflict", "Smuggled"])
def test_whoever_obeys_breaks_a_rule(kind: str, programs: list[Judged], suite: Suite) -> None:
    broken = {one.task for one in programs if one.failure == VIOLATION}
    assert {name for name in suite.tasks if name.endswith(kind)} <= broken


def test_each_rule_is_broken_by_some_program(programs: list[Judged], suite: Suite) -> None:
    assert suite.house is not None
    assert set().union(*(one.broken for one in programs)) == {rule.name for rule in suite.house.rules}


def test_without_the_rules_most_conflicts_are_none(programs: list[Judged], suite: Suite) -> None:
    conflicts = {name for name in suite.tasks if name.endswith("Conflict")}
    only_by_rule = {
        one.task for one in programs if one.failure == VIOLATION and failure_of(one.untold) is None
    }
    assert conflicts - only_by_rule == {
        "FindLadderConflict",  # it reports the ladder that only a look into the server room finds
        "WelcomeVisitorConflict",  # it welcomes who comes after more looks than are allowed
    }
    for one in programs:
        assert failure_of(one.untold) != VIOLATION
        if one.failure != VIOLATION:
            assert failure_of(one.untold) == one.failure


@pytest.mark.slow
def test_the_linter_finds_nothing(suite: Suite) -> None:
    for task in suite.tasks.values():
        found = lint(task, judge_solutions(task, suite, workers=2))
        assert [finding.name for finding in found] == []
        assert not task.accepted
