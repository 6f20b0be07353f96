"""Draws the page of a run: its progress, its failures by task and kind, and all completions."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from urllib.parse import quote

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.web.frame import Button, PlainText, outside
from roboeval.analysis.metrics import percent
from roboeval.evaluation.judging.failures import plural_of
from roboeval.web.heat_map import MAX_NAME, MISSING, TaskCells, models_of, run_address, verb_of
from roboeval.web.run_store import MissingError, RunStore
from roboeval.web.serializers import run_data
from roboeval.web.snapshot import CompletionFilter, Snapshot
from roboeval.web.widgets import (
    REFRESH_SECONDS,
    CompletionList,
    HeatMap,
    date_text,
    score_text,
    show_state,
    tasks_text,
)

SCROLL_TO_COMPLETIONS = "document.getElementById('completions').scrollIntoView()"
RUN_DELETED = "This run was deleted or renamed. The page shows its last known state."


async def draw_run(store: RunStore, name: str, chosen: CompletionFilter, evaluation: str | None) -> None:
    """Draw the page of a run with its results. At first it lists the completions that `chosen` selects."""
    page = _RunPage(store, await asyncio.to_thread(store.open, name, evaluation), chosen, evaluation)
    page.timer = ui.timer(REFRESH_SECONDS, page.refresh, immediate=False)


class _RunPage:
    timer: ui.timer

    def __init__(
        self, store: RunStore, run: Snapshot, chosen: CompletionFilter, evaluation: str | None
    ) -> None:
        self._store, self._run, self._chosen, self._evaluation = store, run, chosen, evaluation
        self._changes = 0
        self._kinds: dict[CompletionFilter, _Kind] = {}
        PlainText("h1", shortened(run.name, MAX_NAME))
        self._error = PlainText("p", "", "trouble").props("role=alert")
        self._error.show_text("")
        self._head = ui.element("div").classes("run-head")
        with ui.element("div").classes("findings"):
            with ui.element("section").classes("pane").props("aria-labelledby=h-heat"):
                self._title = PlainText("h2", "").props("id=h-heat")
                self._heat = HeatMap("Results by task and prompt", "Task", self._choose_cell)
                text = "Percent of each prompt's completions; the first column is the mean."
                PlainText("p", text, "quiet")
            with ui.element("section").classes("pane ends").props("aria-labelledby=h-kinds"):
                PlainText("h2", "Outcomes").props("id=h-kinds")
                self._ends = ui.element("div").classes("kinds")
            with ui.element("section").classes("pane list").props("id=completions aria-labelledby=h-list"):
                with ui.element("div").classes("head"):
                    self._which = PlainText("h2", "").props("id=h-list")
                    self._all = Button("Show all", lambda: self._choose(CompletionFilter()), "plain small")
                self._list = CompletionList()
        self._show()

    async def refresh(self) -> None:
        try:
            run = await asyncio.to_thread(self._store.open, self._run.name, self._evaluation)
        except MissingError:
            self._error.show_text(RUN_DELETED)
            self.timer.deactivate()
            return
        except UserError as error:  # a file may be damaged, or may have changed while being read
            self._error.show_text(str(error))
            return
        self._error.show_text("")
        if run.version != self._run.version:
            self._run = run
            self._changes += 1
            self._show()

    def _choose_cell(self, task: str, prompt: int | None) -> None:
        self._choose(replace(self._chosen, task=task, prompt=prompt))
        ui.run_javascript(SCROLL_TO_COMPLETIONS)

    def _choose_kind(self, kind: CompletionFilter) -> None:
        self._choose(replace(kind, task=self._chosen.task, prompt=self._chosen.prompt))

    def _choose(self, chosen: CompletionFilter) -> None:
        self._chosen = chosen
        ui.navigate.history.replace(outside(run_address(self._run.name)) + chosen.query(self._evaluation))
        self._show_chosen()

    def _show(self) -> None:
        self._head.clear()
        with self._head:
            _draw_head(self._run, has_report=self._store.has_report(self._run.name))
        self._show_chosen()

    def _show_chosen(self) -> None:
        run, chosen = self._run, self._chosen
        cells = TaskCells(run, chosen, self._evaluation)
        rows = [{"name": shortened(task, MAX_NAME), "cells": cells.row(task)} for task in cells.tasks]
        self._heat.show(groups=[{"name": "", "columns": cells.columns}], rows=rows)
        self._title.show_text(f"Share that {verb_of(chosen)}")
        self._which.show_text(_heading(chosen))
        self._all.set_visibility(chosen != CompletionFilter())
        source = f"/api/runs/{quote(run.name, safe='')}/completions{chosen.query(run.results.key) or '?'}"
        query = chosen.query(self._evaluation)
        base = outside(run_address(run.name))
        self._list.show(source=outside(source), base=base, query=query, version=self._changes)
        self._show_kinds()

    def _show_kinds(self) -> None:
        run = self._run
        counts = {
            CompletionFilter(): ("all judged", run.judged),
            CompletionFilter(passed=True): ("passed", run.passed),
        }
        for (cause, name), one in run.failures.items():
            chosen = CompletionFilter(failure_class=cause, failure_kind=name)
            counts[chosen] = name or plural_of(cause), one.count
        if list(self._kinds) != list(counts):
            self._ends.clear()
            with self._ends:
                self._kinds = {
                    kind: _Kind(name, kind, self._choose_kind) for kind, (name, _) in counts.items()
                }
        for kind, (_, count) in counts.items():
            self._kinds[kind].show(count, run.judged, is_here=kind == self._chosen.without_prompt)


class _Kind:
    """A button that shows how often an outcome occurs and selects it."""

    def __init__(self, name: str, kind: CompletionFilter, choose: Callable[[CompletionFilter], None]) -> None:
        look = "kind" + " of-class" * (kind.failure_kind is not None)
        look += " bad-kind" * (kind.failure_class is not None)
        with Button("", lambda: choose(kind), look) as self._button:
            PlainText("span", shortened(name, MAX_NAME))
            self._count = PlainText("b")
            self._share = PlainText("small", "", "quiet")

    def show(self, count: int, total: int, *, is_here: bool) -> None:
        self._button.props(f"aria-pressed={'true' if is_here else 'false'}")
        self._button.style(f"--share: {count / total if total else 0:.3f}")
        self._count.show_text(f"{count:,}")
        self._share.show_text(f"{percent(count / total)}%" if total else MISSING)


def _draw_head(run: Snapshot, *, has_report: bool) -> None:
    data, key = run_data(run), run.results.key
    with ui.element("p").classes("facts"):
        state = PlainText("small")
        PlainText("span", models_of(run) + (f", judged by {shortened(key, MAX_NAME)}" if key else ""))
        PlainText("b", score_text(run.pass_at_1))
        PlainText("span", f"{run.results.coverage}, {tasks_text(data)} tasks")
        if data["date"] is not None:
            PlainText("span", f"started {date_text(data)} UTC", "quiet")
        if data["settings"]:
            PlainText("span", shortened(data["settings"], 200), "quiet")
    show_state(data, state, html.progress(max="1").classes("long"))
    with ui.element("ul").classes("notes"):
        for sentence in data["notes"]:
            PlainText("li", sentence, "unsure")
    with ui.element("p").classes("facts"):
        if has_report:
            html.a("Report of this run", href=outside(f"/api/runs/{quote(run.name, safe='')}/report"))
        for other in run.evaluations if len(run.evaluations) > 1 else ():
            address = run_address(run.name) + CompletionFilter().query(other)
            link = html.a(shortened(other, MAX_NAME), href=outside(address))
            if other == key:
                link.props('aria-current="true"')


def _heading(chosen: CompletionFilter) -> str:
    parts = []
    if chosen.task is not None:
        parts.append(f"of {shortened(chosen.task, MAX_NAME)}")
    if chosen.prompt is not None:
        parts.append(f"prompt {chosen.prompt}")
    if chosen.without_prompt != CompletionFilter():
        parts.append(f"that {verb_of(chosen)}")
    return f"Completions {', '.join(parts)}".rstrip()
