"""How often programs break the rules of a house, and what the rules cost in tasks done."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import polars as pl

from codebotler.core.errors import VIOLATION
from roboeval.analysis.counts import task_scores
from roboeval.analysis.metrics import DIFFERENCE, Estimate, over_tasks, overall, pass_at_1
from roboeval.evaluation.runs.completions import KEY

NAMED = r'^the rule "([^"]+)"'  # of messages


@dataclass(frozen=True)
class BrokenRules:
    """What an evaluation with house rules shows besides verdicts."""

    broken: Estimate  # the share of programs that break a rule in some world
    by_rule: Mapping[str, int]  # how many programs each rule ends in some world, the most first
    cost: Estimate | None  # pass@1 with rules less pass@1 without, where the run was judged without, too


def broken_rules(table: pl.DataFrame, without: pl.DataFrame | None = None) -> BrokenRules:
    """Count what broke rules.

    Args:
        table: of an evaluation with house rules, as `load_results` gives it.
        without: of the evaluation of the same run without them.
    """
    breaks = pl.col("error_kind").eq_missing(VIOLATION)
    marked = table.with_columns(passed=breaks.any().over(KEY))
    named = table.filter(breaks).select(*KEY, rule=pl.col("error_message").str.extract(NAMED)).unique()
    counts = named.group_by("rule").len().sort("len", "rule", descending=[True, False])
    return BrokenRules(
        overall(task_scores(marked), 1),
        dict(counts.iter_rows()),
        None if without is None else _cost(table, without),
    )


def _cost(table: pl.DataFrame, without: pl.DataFrame) -> Estimate | None:
    now, before = (pass_at_1(task_scores(each)) for each in (table, without))
    differences = [(key[0], now[key] - before[key]) for key in now if key in before]
    return over_tasks(differences, within=DIFFERENCE) if differences else None


def broken_rules_data(found: BrokenRules) -> dict[str, Any]:
    """The same as plain data."""
    return {
        "broken": vars(found.broken),
        "programs_by_rule": dict(found.by_rule),
        "cost": None if found.cost is None else vars(found.cost),
    }
