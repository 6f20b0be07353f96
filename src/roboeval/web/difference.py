"""By how much the second of two runs is better, task by task, and the completions that tell them apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import polars as pl
from nicegui import html, ui

from codebotler.core.terminal import shortened
from codebotler.web.frame import PlainText
from roboeval.analysis.compare import compared, verdict
from roboeval.analysis.metrics import Estimate, by_formula, pass_at_1
from roboeval.analysis.statistics import DIFFERENCE
from roboeval.evaluation.runs.completions import KEY, Key, name_of
from roboeval.web.heat_map import address
from roboeval.web.snapshot import Snapshot

MOST_NAME, MOST_TASKS, MOST_KEYS = 60, 100, 30
HEADS = ("Task", "Difference", "95% interval", "Different verdicts")


@dataclass(frozen=True)
class TaskRow:
    """How two runs differ in a task."""

    task: str
    shares: tuple[float, float]  # of completions that pass, mean over the prompts that both have
    difference: Estimate  # the second minus the first, with prompts drawn at random
    differing: tuple[tuple[Key, bool], ...]  # where one run's passes, and whether it is the second's


def task_rows(first: Snapshot, second: Snapshot) -> list[TaskRow]:
    """The tasks that both runs have, those that differ most first."""
    scores = [pass_at_1(run.scores) for run in (first, second)]
    prompts: dict[str, list[tuple[float, float]]] = {}
    for key in scores[0]:
        if key in scores[1]:
            prompts.setdefault(key[0], []).append((scores[0][key], scores[1][key]))
    differing = _differing(first, second)
    rows = [
        TaskRow(
            task,
            (sum(a for a, _ in pairs) / len(pairs), sum(b for _, b in pairs) / len(pairs)),
            by_formula([[b - a] for a, b in pairs], within=DIFFERENCE),
            tuple(differing.get(task, ())),
        )
        for task, pairs in prompts.items()
    ]
    return sorted(rows, key=lambda row: (-abs(row.difference.mean), row.task))


def _differing(first: Snapshot, second: Snapshot) -> dict[str, list[tuple[Key, bool]]]:
    judged = [run.completions.drop_nulls("passed").select(*KEY, "passed") for run in (first, second)]
    both = judged[0].join(judged[1], on=KEY, how="inner", suffix="_second", maintain_order="left")
    found: dict[str, list[tuple[Key, bool]]] = {}
    for task, prompt, index, _, passed in both.filter(
        pl.col("passed") != pl.col("passed_second")
    ).iter_rows():
        found.setdefault(task, []).append(((task, prompt, index), passed))
    return found


@dataclass(frozen=True)
class Difference:
    """How two judged runs differ."""

    runs: tuple[Snapshot, Snapshot]
    rows: tuple[TaskRow, ...]
    told: str  # which is better, and how sure that is


def difference_of(first: Snapshot, second: Snapshot) -> Difference:
    """Compare two judged runs, which may take seconds for large ones."""
    rows = task_rows(first, second)
    told = "They have no prompt in common."
    if rows:
        names = shortened(first.name, MOST_NAME), shortened(second.name, MOST_NAME)
        told = verdict(compared(pass_at_1(first.scores), pass_at_1(second.scores)), names)
    return Difference((first, second), tuple(rows[:MOST_TASKS]), told)


def draw_difference(difference: Difference) -> None:
    """Draw how two judged runs differ."""
    runs, rows = difference.runs, difference.rows
    names = [shortened(run.name, MOST_NAME) for run in runs]
    PlainText("p", difference.told)
    if not rows:
        return
    region = ui.element("div").classes("sideways").props('tabindex=0 role=region aria-label="Differences"')
    with region, html.table().classes("differences"):
        with html.thead(), html.tr():
            for head in (HEADS[0], *names, *HEADS[1:]):
                PlainText("th", head).props("scope=col")
        with html.tbody():
            for row in rows:
                _draw_row(row, runs)


def _draw_row(row: TaskRow, runs: Sequence[Snapshot]) -> None:
    estimate = row.difference
    with html.tr():
        PlainText("th", shortened(row.task, MOST_NAME)).props("scope=row")
        for share in row.shares:
            PlainText("td", f"{share:.2f}", "number")
        PlainText("td", f"{estimate.mean:+.2f}", "number strong")
        PlainText("td", f"{estimate.low:+.2f} to {estimate.high:+.2f}", "number")
        with html.td():
            if row.differing:
                _draw_differing(row, runs)


def _draw_differing(row: TaskRow, runs: Sequence[Snapshot]) -> None:
    with html.details():
        PlainText("summary", f"{len(row.differing):,}")
        with ui.element("ul"):
            for key, is_second in row.differing[:MOST_KEYS]:
                with ui.element("li"):
                    PlainText("span", f"{name_of(key)}: ")
                    for run, text in zip(runs, _verdicts(is_second), strict=True):
                        link = html.a(f"{shortened(run.name, MOST_NAME)} {text}")
                        link.props["href"] = f"{address(run.name)}/{name_of(key)}"
            if (left := len(row.differing) - MOST_KEYS) > 0:
                PlainText("li", f"and {left:,} more")


def _verdicts(is_second: bool) -> Iterator[str]:  # noqa: FBT001 - which of two
    yield from ("failed", "passed") if is_second else ("passed", "failed")
