"""Builds the section that compares programs with agents, if there is a run of an agent."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.analysis.missions import has_missions, mission_costs
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Cell, Section, section, sheet


def modes(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on the missions of each run."""
    has_agent = any(has_missions(run.table) for run in runs)
    rows: list[list[Cell]] = []
    for run in runs if has_agent else ():
        one = mission_costs(run.table)
        share = one.satisfied.mean, one.satisfied.low, one.satisfied.high, one.forbidden
        means = one.turns, one.tool_errors, one.tokens, one.tokens_per_success
        rows.append([run.name, one.mode, one.missions, *share, *means])
    return section("modes", sheet("modes", rows))
