"""Counts passed and failed completions in the table of a run."""

from __future__ import annotations

from collections.abc import Iterable

import polars as pl

from roboeval.analysis.counting.tally import Tally
from roboeval.analysis.metrics import TaskScore, pass_at_k
from roboeval.evaluation.runs.completions import KEY


def completions_of(table: pl.DataFrame) -> pl.DataFrame:
    """Reduce a table from `load_results` to one row for each judged completion."""
    return table.filter(pl.col("world_number") == 0)


def prompt_scores(table: pl.DataFrame) -> pl.DataFrame:
    """Count the judged (`n`) and passed (`c`) completions of each prompt, and compute its `pass@1`."""
    counted = completions_of(table).group_by("task", "prompt", maintain_order=True)
    return counted.agg(n=pl.len(), c=pl.col("passed").sum()).with_columns(
        pl.struct("n", "c")
        .map_elements(lambda one: pass_at_k(one["n"], one["c"], 1), return_dtype=pl.Float64)
        .alias("pass@1")
    )


def task_scores(table: pl.DataFrame, order: Iterable[str] = ()) -> tuple[TaskScore, ...]:
    """Compute the scores of tasks and prompts (paper, section IV.C). Tasks not in `order` come last."""
    return tally_of(table).scores(order)


def tally_of(table: pl.DataFrame) -> Tally:
    """Count the judged, passed and failed completions in a table."""
    tally = Tally()
    completions = completions_of(table)
    for task, prompt, n, c, _ in prompt_scores(table).iter_rows():
        tally.judged[task, prompt], tally.passed[task, prompt] = n, c
    failed = completions.drop_nulls("failure_class")
    for name, kind, count in failed.group_by("failure_class", "failure_kind").len().iter_rows():
        tally.failed[name, kind] = count
    tally.first_failed = next(completions.filter(~pl.col("passed")).select(KEY).iter_rows(), None)
    return tally
