"""Counts judged, passed and failed completions, while they are judged or in the table of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeAlias

from roboeval.analysis.metrics import PromptScore, TaskScore
from roboeval.evaluation.runs.rows import Row

if TYPE_CHECKING:
    import polars as pl  # loads slowly, and counting while completions are judged does not need it

Tally: TypeAlias = Counter[tuple[str, int, bool, str | None, str | None]]
"""Numbers of completions by task, prompt, whether they passed, and class and kind of the failure."""


def outcome_of(row: Row) -> tuple[str, int, bool, str | None, str | None]:
    """Return a row's key in a `Tally`: task, prompt, whether it passed, and the failure's class and kind."""
    why = row["failure"]
    failed = (None, None) if why is None else (why["class"], why["kind"])
    return row["task"], row["prompt"], why is None, *failed


def completions_of(table: pl.DataFrame) -> pl.DataFrame:
    """Reduce a table from `load_results` to one row for each judged completion."""
    return table.filter(table["world_number"] == 0)


def tally_of(table: pl.DataFrame) -> Tally:
    """Count the judged completions in a table by task, prompt and kind of failure."""
    columns = "task", "prompt", "passed", "failure_class", "failure_kind"
    counted = completions_of(table).group_by(columns, maintain_order=True).len()
    return Counter({tuple(outcome): count for *outcome, count in counted.iter_rows()})


def scores_of(tally: Tally, order: Iterable[str] = ()) -> tuple[TaskScore, ...]:
    """Compute each task's score (paper, section IV.C), in this `order` of tasks. Other tasks come last."""
    judged: Counter[tuple[str, int]] = Counter()
    passed: Counter[tuple[str, int]] = Counter()
    for (task, prompt, has_passed, *_), count in tally.items():
        judged[task, prompt] += count
        passed[task, prompt] += count * has_passed
    prompts: dict[str, list[PromptScore]] = {task: [] for task in order}
    for key, n in judged.items():
        prompts.setdefault(key[0], []).append(PromptScore(*key, n, passed[key]))
    return tuple(
        TaskScore(task, tuple(sorted(scores, key=lambda score: score.prompt)))
        for task, scores in prompts.items()
        if scores
    )


def task_scores(table: pl.DataFrame, order: Iterable[str] = ()) -> tuple[TaskScore, ...]:
    """Compute the score of each task in a table, in this `order` of tasks. Other tasks come last."""
    return scores_of(tally_of(table), order)
