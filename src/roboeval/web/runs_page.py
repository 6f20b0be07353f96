"""Draws the page of all runs with their models, progress and pass rates."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.web.frame import PlainText, outside
from roboeval.analysis.metrics import Estimate
from roboeval.web.heat_map import MAX_NAME, MISSING, run_address
from roboeval.web.serializers import RunList
from roboeval.web.widgets import REFRESH_SECONDS, count_text, date_text, show_state, tasks_text

MAX_READ_SECONDS = 0.5  # seconds to wait before the page shows runs that are not read yet

TABLE_HEADS = ("Run", "Suite", "Tasks", "State", "Completions", "pass@1", "Started")
TABLE_NOTE = "pass@1 with its 95% confidence interval over tasks; times are in UTC."
NO_RUNS_SENTENCE = "There are no runs yet. This command creates one without an API key or a network:"
EXAMPLE_COMMAND = "run --model recorded:hasty --num-completions 3"


async def draw_runs(folder: Path, runs: RunList) -> None:
    """Draw a table of the runs in a folder, which is refreshed every second."""
    PlainText("h1", "Runs")
    PlainText("p", f"In {shortened(str(await asyncio.to_thread(folder.resolve)), 200)}", "quiet")
    table = _Table(runs)
    await table.refresh()
    ui.timer(REFRESH_SECONDS, table.refresh, immediate=False)


class _Table:
    def __init__(self, runs: RunList) -> None:
        self._runs = runs
        self._rows: list[_RunRow] = []
        self._error = PlainText("p", "", "trouble").props("role=alert")
        self._empty = ui.element("div").classes("first-run")
        with self._empty:
            PlainText("p", NO_RUNS_SENTENCE, "quiet")
            PlainText("pre", f"roboeval {EXAMPLE_COMMAND}", "source").props("tabindex=0")
        self._form = ui.element("form").props(f"action={outside('/side-by-side')} method=get")
        with self._form:
            region = ui.element("div").classes("sideways").props('tabindex=0 role=region aria-label="Runs"')
            with region, html.table().classes("runs"):
                with html.thead(), html.tr():
                    with html.th().props("scope=col").classes("tick"):
                        PlainText("span", "Side by side", "unseen")
                    for name in TABLE_HEADS:
                        PlainText("th", name).props("scope=col")
                self._body = html.tbody()
            PlainText("p", TABLE_NOTE, "quiet")
            html.button("Show side by side", type="submit").classes("plain")

    async def refresh(self) -> None:
        try:
            data = await asyncio.to_thread(self._runs.data, MAX_READ_SECONDS)
        except UserError as error:
            self._error.show_text(str(error))
        else:
            self._error.show_text("")
            self._show(data)

    def _show(self, data: list[dict[str, Any]]) -> None:
        self._empty.set_visibility(not data)
        self._form.set_visibility(bool(data))
        if [row.name for row in self._rows] != [run["run"] for run in data]:
            self._body.clear()
            with self._body:
                self._rows = [_RunRow(run["run"]) for run in data]
        for row, run in zip(self._rows, data, strict=True):
            row.show(run)


class _RunRow:
    def __init__(self, name: str) -> None:
        self.name = name
        with html.tr():
            with html.td().classes("tick"):
                box = ui.element("input").props("type=checkbox name=run")
                box.props["value"] = name
                box.props["aria-label"] = f"Compare {shortened(name, MAX_NAME)} with others"
            with html.th().props("scope=row"):
                with html.a(href=outside(run_address(name))):
                    PlainText("b", shortened(name, MAX_NAME))
                self._models = PlainText("span", "", "quiet")
                self._settings = PlainText("span", "", "quiet note")
                self._notes = PlainText("span", "", "bad note")
            with html.td():
                self._suite = PlainText("span")
            with html.td().classes("tasks"):
                self._tasks = PlainText("span")
            with html.td():
                self._state = PlainText("small")
                self._bar = html.progress(max="1")
            with html.td().classes("count"):
                self._count = PlainText("span")
            with html.td().classes("score"):
                self._score = PlainText("b")
                self._interval = PlainText("span", "", "quiet")
                self._meter = ui.element("span").classes("meter").props("aria-hidden=true")
            with html.td().classes("date"):
                self._date = PlainText("span")

    def show(self, run: Mapping[str, Any]) -> None:
        by_hand = ", programs written by hand" if run.get("by_hand") else ""
        self._models.show_text(shortened(", ".join(run.get("models", ())), 160) + by_hand)
        self._settings.show_text(shortened(run.get("settings") or "", 160))
        self._tasks.show_text(tasks_text(run))
        self._date.show_text(date_text(run))
        self._notes.show_text(" ".join(run["notes"][:1]))
        self._suite.show_text(shortened(str(run.get("evaluation") or run.get("suite") or MISSING), MAX_NAME))
        show_state(run, self._state, self._bar)
        self._count.show_text(count_text(run))
        mean = run.get("pass@1")
        self._score.show_text(MISSING if mean is None else f"{mean['mean']:.3f}")
        self._interval.show_text("" if mean is None else Estimate(**mean).ends(".2f"))
        self._meter.set_visibility(mean is not None)
        self._meter.style(f"--share: {0 if mean is None else mean['mean']:.3f}")
