"""Counts how often programs break house rules, and measures how much the rules lower pass@1."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import polars as pl

from codebotler.core.errors import VIOLATION
from roboeval.analysis.counting.counts import task_scores
from roboeval.analysis.metrics import DIFFERENCE, Estimate, over_tasks, overall, pass_at_1
from roboeval.evaluation.runs.completions import KEY

RULE_NAME = r'^the rule "([^"]+)"'  # how messages about broken rules begin


@dataclass(frozen=True)
class BrokenRules:
    """Describes how often programs break house rules, and by how much the rules change pass@1."""

    broken: Estimate  # share of programs that break a rule in at least one world
    by_rule: Mapping[str, int]  # programs that each rule stops in at least one world, largest number first
    cost: Estimate | None  # pass@1 with rules minus pass@1 without; None if not judged without rules


def count_broken_rules(table: pl.DataFrame, without: pl.DataFrame | None = None) -> BrokenRules:
    """Count the programs that break house rules, and compute how much the rules change pass@1.

    Args:
        table: The results of an evaluation with house rules, from `load_results`.
        without: The results of the same run, judged without house rules, or None if there are none.
    """
    breaks = pl.col("error_kind").eq_missing(VIOLATION)
    marked = table.with_columns(passed=breaks.any().over(KEY))
    named = table.filter(breaks).select(*KEY, rule=pl.col("error_message").str.extract(RULE_NAME)).unique()
    counts = named.group_by("rule").len().sort("len", "rule", descending=[True, False])
    cost = None
    if without is not None:
        now, before = (pass_at_1(task_scores(each)) for each in (table, without))
        differences = [(key[0], now[key] - before[key]) for key in now if key in before]
        cost = over_tasks(differences, within=DIFFERENCE) if differences else None
    return BrokenRules(overall(task_scores(marked), 1), dict(counts.iter_rows()), cost)


def broken_rules_data(found: BrokenRules) -> dict[str, Any]:
    """Convert the counts of broken rules to JSON data, for `roboeval show --json`."""
    return {
        "broken": vars(found.broken),
        "programs_by_rule": dict(found.by_rule),
        "cost": None if found.cost is None else vars(found.cost),
    }
