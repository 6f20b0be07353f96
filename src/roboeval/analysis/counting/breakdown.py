"""Breaks down pass rates by required ability, by whether the robot must report back, and by phrasing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import polars as pl

from roboeval.analysis.counting.counts import completions_of, prompt_scores, task_scores
from roboeval.analysis.metrics import Estimate, by_formula, mean_of
from roboeval.evaluation.judging.failures import FAILURE_CLASSES
from roboeval.evaluation.runs.completions import KEY
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.rows import Row, failure_of
from roboeval.evaluation.runs.traces import trace_of
from roboeval.suites.load import Suite

REPORT_ABILITY = "report-back"
NO_SUCH_ROOM_ERROR = "GoToInvalidLocation"


def by_ability(table: pl.DataFrame, suite: Suite) -> Iterator[tuple[str, int, Estimate, Mapping[str, float]]]:
    """Break down results by the abilities that tasks require (paper, section V.B).

    Yields each ability, the number of judged tasks that require it, their pass@1 with its interval over
    tasks, and the share of their completions that fail in each class.
    """
    scores = {one.task: [p.pass_at(1) for p in one.prompts] for one in task_scores(table, suite.tasks)}
    counted = completions_of(table).group_by("task", "failure_class").len()
    failed = {(task, name): count for task, name, count in counted.iter_rows()}
    for ability in dict.fromkeys(ability for task in suite.tasks.values() for ability in task.abilities):
        tasks = [name for name in scores if name in suite.tasks and ability in suite.tasks[name].abilities]
        total = sum(count for (task, _), count in failed.items() if task in tasks)
        shares = {
            name: sum(failed.get((task, name), 0) for task in tasks) / (total or 1)
            for name in FAILURE_CLASSES
        }
        if tasks:
            yield ability, len(tasks), by_formula([scores[name] for name in tasks], over="tasks"), shares


def compare_report_back(results: Results) -> pl.DataFrame:
    """Compare the tasks that end with a report to all other tasks (paper, section V.B).

    Returns one row for each value of `reports`, or no rows if no task ends with a report. The other columns
    are `pass@1`, the number of `completions`, how many of them `failed`, and in how many of the failures the
    robot never came back to its starting room (`never_returned`) or was sent to an unknown room (`lost`).
    """
    suite = results.known_suite
    reports = pl.col("task").is_in(
        [name for name, task in suite.tasks.items() if REPORT_ABILITY in task.abilities]
    )
    table = results.table.with_columns(reports=reports)
    scores = prompt_scores(table).group_by(reports=reports)
    counts = scores.agg("pass@1", completions=pl.col("n").sum(), failed=(pl.col("n") - pl.col("c")).sum())
    away = [(*key, never_returned(results.row(key))) for key in results.failed]
    keys = {name: table.schema[name] for name in KEY}
    returns = pl.DataFrame(away, schema={**keys, "away": pl.Boolean}, orient="row")
    found = (
        completions_of(table)
        .join(returns, on=KEY, how="left")
        .group_by("reports")
        .agg(
            never_returned=pl.col("away").sum(),
            lost=(pl.col("failure_kind") == NO_SUCH_ROOM_ERROR).sum(),
        )
        .join(counts.with_columns(_mean("pass@1")), on="reports")
        .select("reports", "completions", "failed", "never_returned", "lost", "pass@1")
        .sort("reports", descending=True)
    )
    return found.filter(pl.col("reports").any())


def _mean(lists: str) -> pl.Expr:
    return pl.col(lists).map_elements(lambda values: mean_of([values]), return_dtype=pl.Float64)


def never_returned(row: Row) -> bool:
    """Whether the robot left its starting room for good in the world where the completion failed.

    Returns False if the trace was too long to be stored.
    """
    verdict = row["verdicts"][failure_of(row)["world"]]
    if "cut" in verdict:
        return False
    trace = trace_of(verdict)
    start = trace[0].place if trace else ""
    visited = [event.destination for event in trace if event.destination is not None]
    left = next((at for at, room in enumerate(visited) if room != start), None)
    return left is not None and start not in visited[left:]


def spread_by_task(table: pl.DataFrame) -> pl.DataFrame:
    """Compute the spread of pass@1 over the prompts of each task with several prompts (paper, section V.A).

    Columns: `task`, `spread`, `worst_prompt` with its pass@1 `worst`, and `best_prompt` with its pass@1
    `best`. If several prompts are equally good or bad, the first of them is reported.
    """
    prompt, score = pl.col("prompt"), pl.col("pass@1")
    return (
        prompt_scores(table)
        .sort("prompt", maintain_order=True)
        .filter(pl.len().over("task") > 1)
        .group_by("task", maintain_order=True)
        .agg(
            spread=score.max() - score.min(),
            worst_prompt=prompt.get(score.arg_min()),
            worst=score.min(),
            best_prompt=prompt.get(score.arg_max()),
            best=score.max(),
        )
    )


def compare_phrasings(scores: pl.DataFrame) -> pl.DataFrame:
    """Compare each prompt with the mean of its task, for tasks with several prompts (paper, section V.A).

    `scores` has the columns `model`, `task`, `prompt` and `pass@1`. For each prompt, the result says by how
    much it is `better` than its task, averaged over models, and how many of the `models` it `hurts`.
    """
    several = scores.filter(pl.col("prompt").n_unique().over("task") > 1)
    means = several.group_by("model", "task").agg("pass@1").with_columns(mean=_mean("pass@1"))
    better = pl.col("pass@1") - pl.col("mean")
    return (
        several.join(means.drop("pass@1"), on=["model", "task"], maintain_order="left")
        .group_by("task", "prompt", maintain_order=True)
        .agg(better=better.mean(), hurts=(better < 0).sum(), models=pl.len())
    )
