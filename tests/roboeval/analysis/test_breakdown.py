"""Abilities, coming back and phrasing, counted by hand."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import polars as pl
import pytest

from codebotler.core.trace import Event, trace_data
from codebotler.core.world import Room, World
from made_results import VERDICT, as_driven, results_of
from made_up_runs import SUITE, made_up
from roboeval.analysis.counting.breakdown import (
    by_ability,
    compare_phrasings,
    compare_report_back,
    never_returned,
    spread_by_task,
)
from roboeval.analysis.counting.counts import prompt_scores
from roboeval.evaluation.runs.rows import Row
from roboeval.evaluation.runs.traces import circumstances
from roboeval.suites.load import Scenario

WORLD = World((Room("start"), Room("kitchen")), "start", about="w")
VISIT = replace(
    SUITE.tasks["Visit"], abilities=("navigation", "report-back"), scenarios=(Scenario(WORLD, ()),)
)
FIND = replace(SUITE.tasks["FindBook"], abilities=("navigation",))
ABLE = replace(SUITE, tasks={"Visit": VISIT, "FindBook": FIND})


def test_abilities_by_hand() -> None:
    table = made_up("a", {"Visit": (10, 4), "FindBook": (0,)}).table
    navigation, report = by_ability(table, ABLE)
    assert (navigation[0], report[0]) == ("navigation", "report-back")
    assert (navigation[1], report[1]) == (2, 1)
    assert [navigation[2].mean, report[2].mean] == pytest.approx([14 / 30, 0.7])
    assert sum(navigation[3].values()) == pytest.approx(16 / 30)
    assert [*by_ability(table, SUITE)] == []


def row(*drives: str, index: int = 0, kind: str = "SayAtLocation") -> dict[str, Any]:
    trace = as_driven(WORLD, Event("say", "hello"), *(Event("goto", room) for room in drives))
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
def test_who_never_returned(drives: Sequence[str], *, away: bool) -> None:
    assert never_returned(cast("Row", row(*drives))) is away


def test_coming_back_by_hand() -> None:
    passed = {"task": "Visit", "prompt": 0, "index": 0, "passed": True}
    failed = [
        row("kitchen", index=1),
        row("kitchen", "start", index=2),
        row("moon", index=3, kind="GoToInvalidLocation"),
    ]
    (found,) = compare_report_back(results_of([passed, *failed], ABLE)).to_dicts()
    assert found == {
        "reports": True,
        "completions": 4,
        "failed": 3,
        "never_returned": 1,
        "lost": 1,
        "pass@1": 0.25,
    }
    assert compare_report_back(results_of([passed, *failed], SUITE)).is_empty()


def test_tasks_without_a_report_stand_beside() -> None:
    run = made_up("a", {"FindBook": (2,), "Visit": (1,)}, suite=ABLE)
    found = compare_report_back(run.results)
    assert found["reports"].to_list() == [True, False]
    assert found["pass@1"].to_list() == pytest.approx([0.1, 0.2])
    assert compare_report_back(made_up("a", {"FindBook": (2,)}, suite=ABLE).results).is_empty()


def test_spread_by_hand() -> None:
    table = made_up("a", {"Visit": (4, 9, 2, 9, 2), "FindBook": (3,)}).table
    (found,) = spread_by_task(table).to_dicts()
    assert found == {
        "task": "Visit",
        "spread": pytest.approx(0.7),
        "worst_prompt": 2,
        "worst": 0.2,
        "best_prompt": 1,
        "best": 0.9,
    }


def test_which_phrasing_hurts() -> None:
    runs = [made_up("a", {"Visit": (10, 4)}), made_up("b", {"Visit": (6, 2), "FindBook": (1,)})]
    tables = [prompt_scores(run.table) for run in runs]
    scores = pl.concat([table.with_columns(model=pl.lit(at)) for at, table in enumerate(tables)])
    best, worst = compare_phrasings(scores).to_dicts()
    assert (worst["task"], worst["prompt"], worst["better"]) == ("Visit", 1, pytest.approx(-0.25))
    assert (worst["hurts"], worst["models"]) == (2, 2)
    assert (best["better"], best["hurts"]) == (pytest.approx(0.25), 0)
