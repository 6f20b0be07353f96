"""Builds the section on house rules: how often programs break them, and their effect on pass@1."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.analysis.counting.broken_rules import count_broken_rules
from roboeval.analysis.counting.counts import task_scores
from roboeval.analysis.metrics import overall
from roboeval.report.runs import JudgedRun
from roboeval.report.sheets import Cell, Section, section, sheet


def house(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on house rules, for runs judged both with and without them."""
    rows: list[list[Cell]] = []
    by_rule: list[list[Cell]] = []
    notes = []
    for run in runs:
        if run.house is None:
            continue
        found = count_broken_rules(run.house.table, run.results.table)
        broken, cost = found.broken, found.cost
        assert cost is not None, "it was also judged without rules"
        scores = overall(run.scores, 1).mean, overall(task_scores(run.house.table), 1).mean
        rows.append([run.name, broken.mean, broken.low, broken.high, *scores, cost.mean, cost.low, cost.high])
        by_rule += [[rule, run.name, count] for rule, count in found.by_rule.items()]
        notes += [
            f"{run.name}: the interval of the {what} is {estimate.ends()}."
            for what, estimate in (("share that breaks a rule", broken), ("difference", cost))
            if not estimate.is_known
        ]
    return section("house", sheet("house", rows, notes=notes), sheet("broken-rules", by_rule))
