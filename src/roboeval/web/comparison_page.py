"""The page of several runs side by side: how often each passes, prompt by prompt, and why not."""

from __future__ import annotations

import asyncio
from collections.abc import Hashable, Sequence
from typing import Any

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.web.frame import PlainText, outside
from roboeval.web.difference import PAIR, Difference, differences_of, draw_differences
from roboeval.web.heat_map import TaskCells, address, failure_rows, models_of
from roboeval.web.run_store import RunStore
from roboeval.web.serializers import run_data
from roboeval.web.snapshot import Filter, Snapshot
from roboeval.web.widgets import EVERY, HeatMap, completions_text, score_text, show_state

MOST = 12  # runs side by side; more are no comparison
MOST_NAME = 60
NOT_ALIKE = "These runs were judged by different suites or versions of a suite. Compare with care."


async def draw_comparison(store: RunStore, names: Sequence[str]) -> None:
    """Draw the runs of these names."""
    PlainText("h1", "Runs side by side")
    if not names:
        PlainText("p", "Tick runs in the list, then show them side by side.", "quiet")
        html.a("All runs", href=outside("/runs"))
        return
    if len(names) > MOST:
        PlainText("p", f"These are the first {MOST} of {len(names):,} runs.", "quiet")
    comparison = _Comparison(store, names[:MOST])
    await comparison.refresh()
    ui.timer(EVERY, comparison.refresh, immediate=False)


class _Comparison:
    """Runs beside each other, kept up to date with their folders."""

    def __init__(self, store: RunStore, names: Sequence[str]) -> None:
        self._store, self._names = store, names
        self._versions: list[Hashable] = []
        self._troubles = ui.element("div").props("role=status")
        self._list = ui.element("ul").classes("beside-list")
        self._difference = ui.element("section").classes("pane").props('aria-label="Which is better"')
        with ui.element("section").classes("pane").props("aria-labelledby=h-heat"):
            PlainText("h2", "Where they pass").props("id=h-heat")
            self._tasks = HeatMap("Tasks by prompts, run by run", "Task")
            text = "Percent of the completions of each prompt; the first column of a run is their mean."
            PlainText("p", text, "quiet")
        with ui.element("section").classes("pane causes").props("aria-labelledby=h-kinds"):
            PlainText("h2", "Why they fail").props("id=h-kinds")
            self._kinds = HeatMap("Kinds of failures by run", "Kind of failure")
            PlainText("p", "Percent of all completions of a run.", "quiet")

    async def refresh(self) -> None:
        """Show the runs as they are now."""
        runs, troubles = await asyncio.to_thread(self._read)
        versions: list[Hashable] = [*((run.name, run.version) for run in runs), *troubles]
        if versions != self._versions:
            self._versions = versions
            judged = [run for run in runs if run.judged]
            found = await asyncio.to_thread(differences_of, judged) if len(judged) >= PAIR else []
            self._show(runs, troubles, found)

    def _read(self) -> tuple[list[Snapshot], list[str]]:
        runs, troubles = [], []
        for name in self._names:
            try:
                runs.append(self._store.open(name))
            except UserError as error:
                troubles.append(error.sentence)
        heads = [run.results.head for run in runs if run.judged]
        judged_by = {tuple(str(head.get(part)) for part in ("suite", "digest", "ablation")) for head in heads}
        return runs, [*troubles, *[NOT_ALIKE] * (len(judged_by) > 1)]

    def _show(self, runs: Sequence[Snapshot], troubles: Sequence[str], found: Sequence[Difference]) -> None:
        self._troubles.clear()
        with self._troubles:
            for sentence in troubles:
                PlainText("p", sentence, "trouble")
        self._list.clear()
        with self._list:
            for run in runs:
                _draw_run(run)
        cells = [TaskCells(run, Filter()) for run in runs]
        groups = [{**_head(run), "columns": of.columns} for run, of in zip(runs, cells, strict=True)]
        tasks = dict.fromkeys(task for of in cells for task in of.tasks)
        rows = [
            {"name": shortened(task, MOST_NAME), "cells": [cell for of in cells for cell in of.row(task)]}
            for task in tasks
        ]
        self._tasks.show(groups=groups, rows=rows)
        judged = [run for run in runs if run.judged]
        self._difference.clear()
        self._difference.set_visibility(bool(found))
        if found:
            with self._difference:
                PlainText("h2", "Which is better")
                draw_differences(found)
        columns = [_head(run) for run in judged]
        self._kinds.show(groups=[{"name": "", "columns": columns}], rows=failure_rows(judged))


def _head(run: Snapshot) -> dict[str, Any]:
    return {"name": shortened(run.name, MOST_NAME), "title": models_of(run), "href": address(run.name)}


def _draw_run(run: Snapshot) -> None:
    data = run_data(run)
    with ui.element("li"):
        html.a(shortened(run.name, MOST_NAME), href=outside(address(run.name))).props("dir=auto")
        show_state(data, PlainText("small"))
        PlainText("b", score_text(data))
        PlainText("span", f"{completions_text(data)}, {models_of(run)}", "quiet")
