"""The suite `rules`: its triples of tasks, its programs, and the effect of each house rule."""

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


class JudgedProgram(NamedTuple):
    """A program for a task, and its rows with and without the house rules."""

    task: str
    solution: Solution
    row: Mapping[str, Any]
    plain_row: Mapping[str, Any]

    @property
    def failure(self) -> str | None:
        """Return the kind of its failure with the rules."""
        return failure_of(self.row)

    @property
    def broken(self) -> set[str]:
        """Return the rules that it breaks in some world."""
        errors = (verdict["error"] for verdict in self.row["verdicts"])
        messages = [error["message"] for error in errors if error and error["kind"] == VIOLATION]
        return {match[1] for message in messages if (match := re.search(r'the rule "([^"]+)"', message))}


def failure_of(row: Mapping[str, Any]) -> str | None:
    """Return the kind of the failure in a row."""
    return None if row["failure"] is None else str(row["failure"]["kind"])


@pytest.fixture(scope="module")
def suite() -> Suite:
    return load_suite("rules")


@pytest.fixture(scope="module")
def programs(suite: Suite) -> list[JudgedProgram]:
    listed = [(task.name, one) for task in suite.tasks.values() for one in solutions(task)]
    completions = [
        Completion(task=name, prompt=0, index=index, program=one.program)
        for index, (name, one) in enumerate(listed)
    ]
    rows = evaluate(completions, suite, workers=2)
    plain_rows = evaluate(completions, suite.with_house_rules(None), workers=2)
    judged = zip(listed, rows, plain_rows, strict=True)
    return [JudgedProgram(name, one, row, plain_row) for (name, one), row, plain_row in judged]


def test_tasks_come_in_triples(suite: Suite) -> None:
    families = {re.sub(f"({'|'.join(KINDS)})$", "", name) for name in suite.tasks}
    assert set(suite.tasks) == {family + kind for family in families for kind in KINDS}
    assert len(families) >= 14
    for task in suite.tasks.values():
        assert len(task.prompts) == 1
        assert 2 <= len(task.scenarios) <= 3


def test_the_instructions_of_a_triple_share_most_words(suite: Suite) -> None:
    def words(task: Task) -> set[str]:
        return set(re.findall(r"\w+", task.prompts[0].lower()))

    for name in suite.tasks:
        if name.endswith("Harmless"):
            harmless = words(suite.tasks[name])
            for kind in KINDS[1:]:
                other = words(suite.tasks[name.replace("Harmless", kind)])
                assert len(harmless & other) >= 0.7 * len(harmless), (name, kind)


def test_prompts_have_ten_rules(suite: Suite) -> None:
    assert suite.house is not None
    assert len(suite.house_sentences) == len(suite.house.rules) == 10


def test_all_robots_start_in_the_room_that_a_rule_names(suite: Suite) -> None:
    starts = {scenario.world.robot for task in suite.tasks.values() for scenario in task.scenarios}
    assert starts == {"start_loc"}
    assert suite.house is not None
    assert any('at("start_loc"' in str(rule.formula) for rule in suite.house.rules)


def test_programs_end_as_declared(programs: list[JudgedProgram]) -> None:
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


def test_careful_programs_break_no_rule_in_any_world(programs: list[JudgedProgram], suite: Suite) -> None:
    careful = [one for one in programs if one.solution.fails is None]
    assert {one.task for one in careful} == set(suite.tasks)
    for one in careful:
        assert all(verdict["satisfied"] and verdict["error"] is None for verdict in one.row["verdicts"])


@pytest.mark.parametrize("kind", ["Conflict", "Smuggled"])
def test_obeying_an_instruction_breaks_a_rule(kind: str, programs: list[JudgedProgram], suite: Suite) -> None:
    broken = {one.task for one in programs if one.failure == VIOLATION}
    assert {name for name in suite.tasks if name.endswith(kind)} <= broken


def test_each_rule_is_broken_by_some_program(programs: list[JudgedProgram], suite: Suite) -> None:
    assert suite.house is not None
    assert set().union(*(one.broken for one in programs)) == {rule.name for rule in suite.house.rules}


def test_without_the_rules_most_conflicts_disappear(programs: list[JudgedProgram], suite: Suite) -> None:
    conflicts = {name for name in suite.tasks if name.endswith("Conflict")}
    only_by_rule = {
        one.task for one in programs if one.failure == VIOLATION and failure_of(one.plain_row) is None
    }
    assert conflicts - only_by_rule == {
        "FindLadderConflict",  # It reports a ladder that is seen only in the server room.
        "WelcomeVisitorConflict",  # It welcomes a visitor who comes after too many looks.
    }
    for one in programs:
        assert failure_of(one.plain_row) != VIOLATION
        if one.failure != VIOLATION:
            assert failure_of(one.plain_row) == one.failure


@pytest.mark.slow
def test_the_linter_finds_nothing(suite: Suite) -> None:
    for task in suite.tasks.values():
        found = lint(task, judge_solutions(task, suite, workers=2))
        assert [finding.name for finding in found] == []
        assert not task.accepted
