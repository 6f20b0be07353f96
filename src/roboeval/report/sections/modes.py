"""Builds the section that compares programs with agents, if there is a run of an agent."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

from roboeval.analysis.comparisons.missions import has_missions, mission_costs
from roboeval.analysis.counting.counts import completions_of
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Cell, Section, Sheet, section, sheet


def modes(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on the missions of each run."""
    acted = [run for run in runs if has_missions(run.table)]
    return section("modes", mode_sheet(runs if acted else []), ending_sheet(acted))


def mode_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of missions by run."""
    rows: list[list[Cell]] = []
    for run in runs:
        one = mission_costs(_table(run))
        share = one.satisfied.mean, one.satisfied.low, one.satisfied.high, one.forbidden
        means = one.turns, one.tool_errors, one.tokens, one.tokens_per_success
        rows.append([run.name, one.mode, one.missions, *share, *means])
    return sheet("modes", rows)


def ending_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of the ways in which missions of agents ended, and after how many replies."""
    turns = pl.col("turns")
    columns = (
        pl.len(),
        pl.col("passed").mean(),
        turns.min(),
        turns.median().alias("median"),
        turns.max().alias("max"),
    )
    rows = [
        [run.name, *ended]
        for run in runs
        for ended in completions_of(_table(run))
        .group_by("ending")
        .agg(*columns)
        .sort(["len", "ending"], descending=[True, False])
        .rows()
    ]
    return sheet("endings", rows)


def _table(run: JudgedRun) -> pl.DataFrame:
    return run.table if run.house is None else run.house.table
