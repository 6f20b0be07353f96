"""Builds the tables that compare programs with agents, if there is a run of an agent."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

from codebotler.core.errors import VIOLATION
from roboeval.analysis.comparisons.compare import has_missions, per_mission
from roboeval.analysis.counting.counts import completions_of, task_scores
from roboeval.analysis.metrics import overall
from roboeval.evaluation.runs.endings import OUTSIDE_CONTRACT
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Cell, Sheet, sheet


def mode_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of success and cost per mission of each run. Empty if no run has agents' missions."""
    rows: list[list[Cell]] = []
    for run in runs if any(has_missions(run.table) for run in runs) else ():
        completions, missions = run.completions, per_mission(_table(run))
        success = overall(task_scores(missions), 1)
        tokens = _mean(completions["input_tokens"] + completions["output_tokens"])
        passed = int(missions["satisfied"].sum()) / missions.height
        ended = missions["error_kind"].is_in([VIOLATION, OUTSIDE_CONTRACT]).fill_null(value=False)
        mode = str(completions["mode"].drop_nulls().first() or "program")
        estimate = success.mean, success.low, success.high
        means = _mean(ended) or 0.0, _mean(completions["turns"]), _mean(completions["tool_errors"])
        per_pass = tokens / passed if tokens and passed else None
        rows.append([run.name, mode, missions.height, *estimate, *means, tokens, per_pass])
    return sheet("modes", rows)


def _mean(values: pl.Series) -> float | None:
    known = values.drop_nulls()
    return float(known.sum()) / len(known) if len(known) else None


def ending_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of how agents' missions ended, how many of them passed, and after how many replies."""
    turns = pl.col("turns")
    replies = turns.min(), turns.median().alias("median"), turns.max().alias("max")
    columns = pl.len(), pl.col("passed").mean(), *replies
    rows = [
        [run.name, *ended]
        for run in runs
        if has_missions(run.table)
        for ended in completions_of(_table(run))
        .group_by("ending")
        .agg(*columns)
        .sort(["len", "ending"], descending=[True, False])
        .rows()
    ]
    return sheet("endings", rows)


def _table(run: JudgedRun) -> pl.DataFrame:
    return run.table if run.house is None else run.house.table
