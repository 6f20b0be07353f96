"""The page of one run: how far it has come, where its programs fail and by what, and all of them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any
from urllib.parse import quote

from nicegui import html, ui

from codebotler.terminal import shortened
from codebotler.web.frame import PATIENCE, Frame
from codebotler.web.words import Press, Words
from roboeval.evaluation.failures import plural_of
from roboeval.web.api import Chosen, Evaluation
from roboeval.web.heat_map import NONE, TaskCells, address, columns, failure_text, models_of, percent
from roboeval.web.run_store import RunGoneError, RunStore
from roboeval.web.serializers import run_data
from roboeval.web.snapshot import Filter, Snapshot
from roboeval.web.widgets import EVERY, CompletionList, HeatMap, count_text, draw_state, page, score_text

MOST_NAME = 80
GONE = "This run is gone: its folder was deleted or renamed. What is below was read before."


def add(store: RunStore, frame: Frame) -> None:
    """Put the page at its address.

    Args:
        store: whose runs.
        frame: what all pages have.
    """

    @ui.page("/runs/{run}", response_timeout=PATIENCE)
    async def show_run(run: str, chosen: Chosen, evaluation: Evaluation = None) -> None:
        with page(frame, shortened(run, MOST_NAME)):
            first = await asyncio.to_thread(store.open, run, evaluation)
            shown = _RunPage(store, first, chosen, evaluation)
            timer = ui.timer(EVERY, lambda: shown.refresh(timer), immediate=False)


class _RunPage:
    """A run on the page, kept up to date with its folder."""

    def __init__(
        self,
        store: RunStore,
        run: Snapshot,
        chosen: Filter,
        evaluation: str | None,
    ) -> None:
        self._store, self._run, self._chosen, self._evaluation = store, run, chosen, evaluation
        self._changes = 0
        self._kinds: dict[Filter, _Kind] = {}
        self._head = _Head(run.name)
        with ui.element("div").classes("findings"):
            with ui.element("section").classes("pane").props("aria-labelledby=h-heat"):
                self._title = Words("h2", "").props("id=h-heat")
                self._heat = HeatMap("Tasks by prompts", "Task", self._choose_cell)
                text = "Percent of the completions of each prompt; the first column is their mean."
                Words("p", text, "quiet")
            with ui.element("section").classes("pane ends").props("aria-labelledby=h-kinds"):
                Words("h2", "How they end").props("id=h-kinds")
                self._ends = ui.element("div").classes("kinds")
            with ui.element("section").classes("pane list").props("id=completions aria-labelledby=h-list"):
                with ui.element("div").classes("head"):
                    self._which = Words("h2", "").props("id=h-list")
                    self._all = Press("Show all", lambda: self._choose(Filter()), "plain small")
                self._list = CompletionList(address(run.name))
        self._show(run)

    async def refresh(self, timer: ui.timer) -> None:
        """Show the run as it is now; once it is gone, the timer ends."""
        try:
            run = await asyncio.to_thread(self._store.open, self._run.name, self._evaluation)
        except RunGoneError:
            self._head.trouble(GONE)
            timer.deactivate()
            return
        if run.version != self._run.version:
            self._changes += 1
            self._show(run)

    def _show(self, run: Snapshot) -> None:
        self._run = run
        self._head.show(run)
        self._show_choice()

    def _choose_cell(self, task: str, prompt: int | None) -> None:
        self._choose(replace(self._chosen, task=task, prompt=prompt))

    def _choose(self, chosen: Filter) -> None:
        self._chosen = chosen
        ui.navigate.history.replace(address(self._run.name) + chosen.query(self._evaluation))
        self._show_choice()

    def _show_choice(self) -> None:
        run, chosen = self._run, self._chosen
        cells = TaskCells(run, chosen, self._evaluation)
        rows = [{"name": shortened(task, MOST_NAME), "cells": cells.row(task)} for task in cells.tasks]
        self._heat.show([{"name": "", "columns": columns(cells.prompts)}], rows)
        self._title.say(f"Where they {_verb(chosen)}")
        self._which.say(_heading(chosen))
        self._all.set_visibility(chosen != Filter())
        source = f"/api/runs/{quote(run.name, safe='')}/completions{chosen.query(run.results.key) or '?'}"
        self._list.show(source, chosen.query(self._evaluation), self._changes)
        self._show_kinds()

    def _show_kinds(self) -> None:
        run = self._run
        counts = {Filter(): ("all that were judged", run.judged), Filter(passed=True): ("passed", run.passed)}
        for of in run.failures:
            counts[Filter(failure=of.name)] = plural_of(of.name), of.count
            for kind in of.kinds:
                counts[Filter(failure=of.name, kind=kind.name)] = kind.name, kind.count
        if list(self._kinds) != list(counts):
            self._ends.clear()
            with self._ends:
                self._kinds = {
                    each: _Kind(name, each, self._choose_kind) for each, (name, _) in counts.items()
                }
        for each, (_, count) in counts.items():
            self._kinds[each].show(count, run.judged, is_here=each == self._chosen.verdict)

    def _choose_kind(self, kind: Filter) -> None:
        self._choose(replace(kind, task=self._chosen.task, prompt=self._chosen.prompt))


class _Kind:
    """A way in which programs end, as a button that chooses it."""

    def __init__(self, name: str, chosen: Filter, choose: Callable[[Filter], None]) -> None:
        look = "kind" + " of-class" * (chosen.kind is not None) + " bad-kind" * (chosen.failure is not None)
        with Press("", lambda: choose(chosen), look) as self._button:
            Words("span", shortened(name, MOST_NAME))
            self._count = Words("b", "")
            self._share = Words("small", "", "quiet")

    def show(self, count: int, of: int, *, is_here: bool) -> None:
        """Show how many there are, of how many, and whether it is chosen."""
        self._button.props(f"aria-pressed={'true' if is_here else 'false'}")
        self._button.style(f"--share: {count / of if of else 0:.3f}")
        self._count.say(f"{count:,}")
        self._share.say(f"{percent(count / of)} %" if of else NONE)


class _Head:
    """The top of the page."""

    def __init__(self, name: str) -> None:
        Words("h1", shortened(name, MOST_NAME))
        with ui.element("p").classes("facts"):
            self._state = Words("small", "")
            self._models = Words("span", "")
            self._score = Words("b", "")
            self._count = Words("span", "")
        self._bar = html.progress(max="1").classes("long")
        self._notes = ui.element("ul").classes("notes")
        self._trouble = Words("p", "", "trouble").props("role=alert")
        self._evaluations = ui.element("p").classes("facts")
        self.trouble("")

    def trouble(self, sentence: str) -> None:
        """Show what is wrong."""
        self._trouble.say(sentence)

    def show(self, run: Snapshot) -> None:
        """Show how the run is doing."""
        data: dict[str, Any] = run_data(run)
        draw_state(data, self._state, self._bar)
        key = run.results.key
        self._models.say(models_of(run) + (f", judged by {shortened(key, MOST_NAME)}" if key else ""))
        self._score.say(score_text(data))
        self._count.say(f"{count_text(data)} completions")
        self._notes.clear()
        with self._notes:
            for sentence in data["notes"]:
                Words("li", sentence, "unsure")
        self._evaluations.clear()
        with self._evaluations:
            for other in run.evaluations if len(run.evaluations) > 1 else ():
                link = html.a(shortened(other, MOST_NAME), href=address(run.name) + Filter().query(other))
                if other == key:
                    link.props('aria-current="true"')


def _verb(chosen: Filter) -> str:
    if (by := failure_text(chosen)) is not None:
        return f"fail with {by}"
    return "fail" if chosen.passed is False else "pass"


def _heading(chosen: Filter) -> str:
    """Which completions are listed."""
    parts = []
    if chosen.task is not None:
        parts.append(f"of {shortened(chosen.task, MOST_NAME)}")
    if chosen.prompt is not None:
        parts.append(f"prompt {chosen.prompt}")
    if chosen.verdict != Filter():
        parts.append(f"that {'passed' if chosen.passed else _verb(chosen).replace('fail', 'failed', 1)}")
    return f"Completions {', '.join(parts)}".rstrip()
