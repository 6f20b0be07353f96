"""Counts judged, passed and failed completions, while they are judged or in the table of a run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import TYPE_CHECKING

from roboeval.analysis.metrics import PromptScore, TaskScore
from roboeval.evaluation.runs.rows import Row

if TYPE_CHECKING:
    import polars as pl  # loads slowly, and counting while completions are judged does not need it


class Tally:
    """Counts judged, passed and failed completions."""

    def __init__(self) -> None:
        self.judged: Counter[tuple[str, int]] = Counter()  # by task and prompt
        self.passed: Counter[tuple[str, int]] = Counter()  # by task and prompt
        self.failed: Counter[tuple[str, str]] = Counter()  # by class and kind of the failure

    def add(self, row: Row) -> None:
        """Count a judged completion."""
        prompt, why = (row["task"], row["prompt"]), row["failure"]
        self.judged[prompt] += 1
        self.passed[prompt] += why is None
        if why is not None:
            self.failed[why["class"], why["kind"]] += 1

    def scores(self, order: Iterable[str] = ()) -> tuple[TaskScore, ...]:
        """Compute the scores of tasks and prompts (paper, section IV.C). Tasks not in `order` come last."""
        prompts: dict[str, list[PromptScore]] = {task: [] for task in order}
        for (task, prompt), n in self.judged.items():
            prompts.setdefault(task, []).append(PromptScore(task, prompt, n, self.passed[task, prompt]))
        return tuple(
            TaskScore(task, tuple(sorted(scores, key=lambda score: score.prompt)))
            for task, scores in prompts.items()
            if scores
        )


def completions_of(table: pl.DataFrame) -> pl.DataFrame:
    """Reduce a table from `load_results` to one row for each judged completion."""
    return table.filter(table["world_number"] == 0)


def tally_of(table: pl.DataFrame) -> Tally:
    """Count the judged, passed and failed completions in a table."""
    tally = Tally()
    counted = ("task", "prompt", "passed", "failure_class", "failure_kind")
    groups = completions_of(table).group_by(counted, maintain_order=True).len()
    for task, prompt, passed, name, kind, count in groups.iter_rows():
        tally.judged[task, prompt] += count
        tally.passed[task, prompt] += count * passed
        if name is not None:
            tally.failed[name, kind] += count
    return tally


def task_scores(table: pl.DataFrame, order: Iterable[str] = ()) -> tuple[TaskScore, ...]:
    """Compute the scores of tasks and prompts (paper, section IV.C). Tasks not in `order` come last."""
    return tally_of(table).scores(order)
