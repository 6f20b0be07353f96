"""Draws the page that compares runs by pass rates of prompts and causes of failures."""

from __future__ import annotations

import asyncio
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.web.frame import PlainText, outside
from roboeval.analysis.comparisons.compare import (
    MISSIONS_COMPARED,
    Comparison,
    compare_tables,
    comparison_sentence,
    has_missions,
    pairs_to_compare,
)
from roboeval.analysis.metrics import Estimate
from roboeval.web.heat_map import MAX_NAME, TaskCells, failure_rows, models_of, run_address
from roboeval.web.run_store import RunStore
from roboeval.web.serializers import run_data
from roboeval.web.snapshot import CompletionFilter, Snapshot
from roboeval.web.widgets import REFRESH_SECONDS, HeatMap, score_text, show_state

MAX_COMPARED_RUNS = 12
MAX_PAIR_TASKS = 100
RUNS_IN_PAIR = 2
INTERVAL_NOTE = "The interval for all tasks is over tasks; other intervals are over the prompts of a task."
DIFFERENT_SUITES = (
    "These runs were judged with different suites or versions of a suite. Compare them with care."
)


async def draw_comparison(store: RunStore, names: Sequence[str]) -> None:
    """Draw up to 12 runs with the given names side by side."""
    PlainText("h1", "Runs side by side")
    if not names:
        PlainText("p", "Select runs in the list, then click \u201cShow side by side\u201d.", "quiet")
        html.a("All runs", href=outside("/runs"))
        return
    if len(names) > MAX_COMPARED_RUNS:
        PlainText("p", f"Only the first {MAX_COMPARED_RUNS} of {len(names):,} runs are shown.", "quiet")
    comparison = _Comparison(store, names[:MAX_COMPARED_RUNS])
    await comparison.refresh()
    ui.timer(REFRESH_SECONDS, comparison.refresh, immediate=False)


class _Comparison:
    def __init__(self, store: RunStore, names: Sequence[str]) -> None:
        self._store, self._names = store, names
        self._versions: list[Hashable] = []
        self._errors = ui.element("div").props("role=status")
        self._list = ui.element("ul").classes("beside-list")
        self._difference = ui.element("section").classes("pane").props('aria-label="Which model is better"')
        with ui.element("section").classes("pane").props("aria-labelledby=h-heat"):
            PlainText("h2", "Pass rates").props("id=h-heat")
            self._tasks = HeatMap("Pass rates by task, prompt and run", "Task")
            text = "Percent of each prompt's completions that pass; the first column of a run is the mean."
            PlainText("p", text, "quiet")
        with ui.element("section").classes("pane causes").props("aria-labelledby=h-kinds"):
            PlainText("h2", "Causes of failures").props("id=h-kinds")
            self._kinds = HeatMap("Kinds of failures by run", "Kind of failure")
            PlainText("p", "Percent of all judged completions of a run.", "quiet")

    async def refresh(self) -> None:
        runs, errors = await asyncio.to_thread(self._read)
        versions: list[Hashable] = [*((run.name, run.version) for run in runs), *errors]
        if versions != self._versions:
            self._versions = versions
            judged = [run for run in runs if run.judged]
            found = await asyncio.to_thread(differences_of, judged) if len(judged) >= RUNS_IN_PAIR else []
            self._show(runs, errors, found)

    def _read(self) -> tuple[list[Snapshot], list[str]]:
        runs, errors = [], []
        for name in self._names:
            try:
                runs.append(self._store.open(name))
            except UserError as error:
                errors.append(str(error))
        heads = [run.results.manifest for run in runs if run.judged]
        judged_by = {tuple(str(head.get(part)) for part in ("suite", "digest", "ablation")) for head in heads}
        return runs, [*errors, *[DIFFERENT_SUITES] * (len(judged_by) > 1)]

    def _show(self, runs: Sequence[Snapshot], errors: Sequence[str], found: Sequence[Difference]) -> None:
        self._errors.clear()
        with self._errors:
            for sentence in errors:
                PlainText("p", sentence, "trouble")
        self._list.clear()
        with self._list:
            for run in runs:
                _draw_run(run)
        cells = [TaskCells(run, CompletionFilter()) for run in runs]
        groups = [
            {**_column(run), "columns": run_cells.columns} for run, run_cells in zip(runs, cells, strict=True)
        ]
        tasks = dict.fromkeys(task for run_cells in cells for task in run_cells.tasks)
        rows = [
            {
                "name": shortened(task, MAX_NAME),
                "cells": [cell for run_cells in cells for cell in run_cells.row(task)],
            }
            for task in tasks
        ]
        self._tasks.show(groups=groups, rows=rows)
        judged = [run for run in runs if run.judged]
        self._difference.clear()
        self._difference.set_visibility(bool(found))
        if found:
            with self._difference:
                PlainText("h2", "Which model is better")
                draw_differences(found)
        columns = [_column(run) for run in judged]
        self._kinds.show(groups=[{"name": "", "columns": columns}], rows=failure_rows(judged))


def _column(run: Snapshot) -> dict[str, Any]:
    return {"name": shortened(run.name, MAX_NAME), "title": models_of(run), "href": run_address(run.name)}


def _draw_run(run: Snapshot) -> None:
    with ui.element("li"):
        html.a(shortened(run.name, MAX_NAME), href=outside(run_address(run.name))).props("dir=auto")
        show_state(run_data(run), PlainText("small"))
        PlainText("b", score_text(run.pass_at_1))
        PlainText("span", f"{run.results.coverage}, {models_of(run)}", "quiet")


# --- which of two runs is better


@dataclass(frozen=True)
class Difference:
    """A comparison of two judged runs: a sentence and, if only two runs are compared, results by task."""

    runs: tuple[Snapshot, Snapshot]
    sentence: str  # states which run is better, and how significant the difference is
    comparison: Comparison | None = None  # None if it is not shown, or if they have no prompt in common


def differences_of(runs: Sequence[Snapshot]) -> list[Difference]:
    """Compare judged runs in pairs; two runs also by task. This may take several seconds."""
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
    return Difference((first, second), sentence, found if by_task else None)


def draw_differences(found: Sequence[Difference]) -> None:
    """Draw a sentence for each pair of runs or, if there is only one pair, its comparison by task."""
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
    names, found = [shortened(run.name, MAX_NAME) for run in difference.runs], difference.comparison
    PlainText("p", difference.sentence)
    if found is None:
        return
    largest = sorted(found.tasks, key=lambda one: (-abs(one.difference.mean), one.task))[:MAX_PAIR_TASKS]
    region = ui.element("div").classes("sideways").props('tabindex=0 role=region aria-label="Differences"')
    with region, html.table().classes("differences"):
        with html.thead(), html.tr():
            for head in ("Task", *names, f"{names[1]} \N{MINUS SIGN} {names[0]}", "95% confidence interval"):
                PlainText("th", head).props("scope=col")
        with html.tbody():
            _draw_row("All tasks", found.first, found.second, found.over_tasks)
            for one in largest:
                _draw_row(one.task, one.first, one.second, one.difference)
    PlainText("p", INTERVAL_NOTE, "quiet")


def _draw_row(task: str, first: float, second: float, difference: Estimate) -> None:
    with html.tr():
        PlainText("th", shortened(task, MAX_NAME)).props("scope=row")
        for share in (first, second):
            PlainText("td", f"{share:.2f}", "number")
        PlainText("td", f"{difference.mean:+.2f}", "number strong")
        PlainText("td", difference.ends("+.2f"), "number")
