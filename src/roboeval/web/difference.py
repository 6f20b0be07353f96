"""Compares two runs by task, and lists the completions whose verdicts differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import urlencode

import polars as pl
from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.web.frame import PlainText, outside
from roboeval.analysis.comparisons.compare import (
    MISSIONS_COMPARED,
    compare_tables,
    comparison_sentence,
    pairs_to_compare,
)
from roboeval.analysis.comparisons.missions import has_missions
from roboeval.analysis.metrics import Estimate
from roboeval.evaluation.runs.completions import KEY, CompletionKey, name_of
from roboeval.web.heat_map import MAX_NAME, run_address
from roboeval.web.snapshot import Snapshot

MAX_PAIR_TASKS, MAX_DIFFERING = 100, 30
RUNS_IN_PAIR = 2
DIFFERENCE_HEADS = ("95% confidence interval", "Different verdicts")
INTERVAL_NOTE = "The interval for all tasks is over tasks; other intervals are over the prompts of a task."


@dataclass(frozen=True)
class TaskRow:
    """The difference between two runs in one task, or in all tasks."""

    task: str
    shares: tuple[float, float]  # mean pass@1 over common prompts
    difference: Estimate  # second minus first; interval over prompts, or over tasks for all tasks
    differing: tuple[tuple[CompletionKey, bool], ...]  # pass in one run only, True for the second run


def _find_differing(first: Snapshot, second: Snapshot) -> dict[str, list[tuple[CompletionKey, bool]]]:
    judged = [run.completions.drop_nulls("passed").select(*KEY, "passed") for run in (first, second)]
    both = judged[0].join(judged[1], on=KEY, how="inner", suffix="_second", maintain_order="left")
    found: dict[str, list[tuple[CompletionKey, bool]]] = {}
    for task, prompt, index, _, passed in both.filter(
        pl.col("passed") != pl.col("passed_second")
    ).iter_rows():
        found.setdefault(task, []).append(((task, prompt, index), passed))
    return found


@dataclass(frozen=True)
class Difference:
    """The difference between two judged runs."""

    runs: tuple[Snapshot, Snapshot]
    sentence: str  # states which run is better, and how significant the difference is
    overall: TaskRow | None = None  # over all tasks; None if they have no prompt in common
    rows: tuple[TaskRow, ...] = ()  # by task, the largest differences first


def differences_of(runs: Sequence[Snapshot]) -> list[Difference]:
    """Compare pairs of judged runs, and a single pair also by task. For large runs, this may take seconds."""
    pairs = pairs_to_compare(runs, lambda run: 0.0 if run.pass_at_1 is None else run.pass_at_1.mean)
    return [_difference(*pair, by_task=len(runs) == RUNS_IN_PAIR) for pair in pairs]


def _difference(first: Snapshot, second: Snapshot, *, by_task: bool) -> Difference:
    names = shortened(first.name, MAX_NAME), shortened(second.name, MAX_NAME)
    try:
        tables = first.results.table, second.results.table
        found = compare_tables(*tables)
    except UserError:
        return Difference((first, second), f"{names[0]} and {names[1]} have no prompt in common.")
    sentence = comparison_sentence(found, names)
    if len({has_missions(table) for table in tables}) > 1:
        sentence += f" {MISSIONS_COMPARED[0].upper()}{MISSIONS_COMPARED[1:]}."
    if not by_task:
        return Difference((first, second), sentence)
    overall = TaskRow("All tasks", (found.first, found.second), found.over_tasks, ())
    differing = _find_differing(first, second)
    rows = [
        TaskRow(one.task, (one.first, one.second), one.difference, tuple(differing.get(one.task, ())))
        for one in found.tasks
    ]
    rows.sort(key=lambda row: (-abs(row.difference.mean), row.task))
    return Difference((first, second), sentence, overall, tuple(rows[:MAX_PAIR_TASKS]))


def draw_differences(found: Sequence[Difference]) -> None:
    """Draw the comparison of each pair of runs, and of a single pair also by task."""
    if len(found) == 1:
        _draw_difference(found[0])
        return
    with ui.element("ul").classes("pairs"):
        for one in found:
            with ui.element("li"):
                PlainText("span", one.sentence)
                query = urlencode([("run", run.name) for run in one.runs], errors="replace")
                html.a("By task", href=outside(f"/side-by-side?{query}"))


def _draw_difference(difference: Difference) -> None:
    runs, rows, overall = difference.runs, difference.rows, difference.overall
    names = [shortened(run.name, MAX_NAME) for run in runs]
    PlainText("p", difference.sentence)
    if overall is None:
        return
    region = ui.element("div").classes("sideways").props('tabindex=0 role=region aria-label="Differences"')
    with region, html.table().classes("differences"):
        with html.thead(), html.tr():
            for head in ("Task", *names, f"{names[1]} \N{MINUS SIGN} {names[0]}", *DIFFERENCE_HEADS):
                PlainText("th", head).props("scope=col")
        with html.tbody():
            for row in (overall, *rows):
                _draw_row(row, runs)
    PlainText("p", INTERVAL_NOTE, "quiet")


def _draw_row(row: TaskRow, runs: Sequence[Snapshot]) -> None:
    estimate = row.difference
    with html.tr():
        PlainText("th", shortened(row.task, MAX_NAME)).props("scope=row")
        for share in row.shares:
            PlainText("td", f"{share:.2f}", "number")
        PlainText("td", f"{estimate.mean:+.2f}", "number strong")
        PlainText("td", estimate.ends("+.2f"), "number")
        with html.td():
            if row.differing:
                _draw_differing(row, runs)


def _draw_differing(row: TaskRow, runs: Sequence[Snapshot]) -> None:
    with html.details():
        PlainText("summary", f"{len(row.differing):,}")
        with ui.element("ul"):
            for key, is_second in row.differing[:MAX_DIFFERING]:
                with ui.element("li"):
                    PlainText("span", f"{name_of(key)}: ")
                    verdicts = ("failed", "passed") if is_second else ("passed", "failed")
                    for run, text in zip(runs, verdicts, strict=True):
                        link = html.a(f"{shortened(run.name, MAX_NAME)} {text}")
                        link.props["href"] = outside(f"{run_address(run.name)}/{name_of(key)}")
            if (left := len(row.differing) - MAX_DIFFERING) > 0:
                PlainText("li", f"and {left:,} more")
