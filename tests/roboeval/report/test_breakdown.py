"""Abilities, returns to the start, and phrasings, counted by hand."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import pytest

from codebotler.core.trace import Event, trace_data
from codebotler.core.world import Room, World
from made_results import VERDICT, results_of, with_places
from made_up_runs import SUITE, new_run
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.runs.traces import circumstances
from roboeval.report.runs import JudgedRun
from roboeval.report.sections.breakdown import (
    REPORTING_TASKS,
    ability_sheet,
    never_returned,
    phrasing_sheet,
    report_back_sheet,
    spread_sheet,
)
from roboeval.suites.load import Scenario

WORLD = World((Room("start"), Room("kitchen")), "start", about="w")
VISIT = replace(
    SUITE.tasks["Visit"], abilities=("navigation", "report-back"), scenarios=(Scenario(WORLD, ()),)
)
FIND = replace(SUITE.tasks["FindBook"], abilities=("navigation",))
ABLE = replace(SUITE, tasks={"Visit": VISIT, "FindBook": FIND})


def test_abilities_by_hand() -> None:
    run = new_run("a", {"Visit": (10, 4), "FindBook": (0,)}, suite=ABLE)
    navigation, report = ability_sheet([run]).rows
    assert navigation[:3] == ["navigation", "a", 2]
    assert report[:3] == ["report-back", "a", 1]
    assert [navigation[3], report[3]] == pytest.approx([14 / 30, 0.7])
    assert sum(navigation[6:]) == pytest.approx(16 / 30)
    assert ability_sheet([new_run("a", {"Visit": (1,)})]).rows == []


def row(*drives: str, index: int = 0, kind: str = "SayAtLocation") -> dict[str, Any]:
    trace = with_places(WORLD, Event("say", "hello"), *(Event("goto", room) for room in drives))
    why = {"class": "TaskCompletionError", "kind": kind, "world": 0, "check": "c"}
    verdict = {**VERDICT, "satisfied": False, "trace": trace_data(trace), **circumstances(trace)}
    named = {"task": "Visit", "prompt": 0, "index": index, "passed": False}
    return {**named, "failure": why, "verdicts": [verdict]}


@pytest.mark.parametrize(
    ("drives", "away"),
    [
        ((), False),
        (("kitchen",), True),
        (("kitchen", "start"), False),
        (("start", "kitchen"), True),
        (("the moon",), False),
        (("kitchen", "the moon"), True),
        (("kitchen", "to start please", "kitchen"), False),
    ],
)
def test_a_robot_that_stays_away_never_returned(drives: Sequence[str], *, away: bool) -> None:
    assert never_returned(cast("Row", row(*drives))) is away


def test_returns_by_hand() -> None:
    passed = {"task": "Visit", "prompt": 0, "index": 0, "passed": True}
    failed = [
        row("kitchen", index=1),
        row("kitchen", "start", index=2),
        row("moon", index=3, kind="GoToInvalidLocation"),
    ]
    results = results_of([passed, *failed], ABLE)
    ((_, tasks, completions, share, failures, away, _, lost, _),) = report_back_sheet(
        [JudgedRun(results, results.table)]
    ).rows
    assert (tasks, completions, failures, away, lost, share) == (REPORTING_TASKS, 4, 3, 1, 1, 0.25)
    other = results_of([passed, *failed], SUITE)
    assert report_back_sheet([JudgedRun(other, other.table)]).rows == []


def test_tasks_without_a_report_are_counted_separately() -> None:
    run = new_run("a", {"FindBook": (2,), "Visit": (1,)}, suite=ABLE)
    found = report_back_sheet([run]).rows
    assert [one[1] for one in found] == [REPORTING_TASKS, "others"]
    assert [one[3] for one in found] == pytest.approx([0.1, 0.2])
    assert report_back_sheet([new_run("a", {"FindBook": (2,)}, suite=ABLE)]).rows == []


def test_spread_by_hand() -> None:
    (found,) = spread_sheet([new_run("a", {"Visit": (4, 9, 2, 9, 2), "FindBook": (3,)})]).rows
    assert found[:7] == ["Visit", "a", pytest.approx(0.7), 2, 0.2, 1, 0.9]


def test_phrasings_are_ranked_by_their_effect() -> None:
    runs = [new_run("a", {"Visit": (10, 4)}), new_run("b", {"Visit": (6, 2), "FindBook": (1,)})]
    worst, best = phrasing_sheet(runs).rows
    assert worst[:5] == ["Visit", 1, pytest.approx(-0.25), 2, 2]
    assert best[2:4] == [pytest.approx(0.25), 0]
