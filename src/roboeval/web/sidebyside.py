"""The page of several runs side by side: how often each passes, prompt by prompt, and why not."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import Query
from nicegui import html, ui

from codebotler.badinput import BadInput
from codebotler.terminal import shortened
from codebotler.web.frame import PATIENCE, Frame
from codebotler.web.words import Words
from roboeval.suites.load import Suite
from roboeval.web.overview import EVERY, count_of, score_of
from roboeval.web.parts import Heat, begin
from roboeval.web.seen import Seen, Wanted
from roboeval.web.shades import Shades, address, columns, kinds_table, title_of
from roboeval.web.shelf import Shelf
from roboeval.web.telling import is_same_suite, run_data

MOST = 12
"""Runs side by side; more are no comparison."""

MOST_NAME = 60
ALIKE = "These runs were not all judged alike: their suites, or versions of it, differ. Compare with care."
Names = Annotated[list[str] | None, Query()]


def add(shelf: Shelf, frame: Frame) -> None:
    """Put the page at its address.

    Args:
        shelf: whose runs.
        frame: what all pages have.
    """

    @ui.page("/side-by-side", response_timeout=PATIENCE)
    async def side_by_side(run: Names = None) -> None:
        begin(frame, "Side by side")
        names = list(dict.fromkeys(run or ()))
        with ui.element("div").classes("benchmark"):
            Words("h1", "Runs side by side")
            if not names:
                Words("p", "Tick runs in the list, then show them side by side.", "quiet")
                html.a("All runs", href="/runs")
                return
            if len(names) > MOST:
                Words("p", f"These are the first {MOST} of {len(names):,} runs.", "quiet")
            page = _SideBySide(shelf, names[:MOST])
            await page.refresh()
        ui.timer(EVERY, page.refresh, immediate=False)


class _SideBySide:
    """Runs beside each other, kept in step with their folders."""

    def __init__(self, shelf: Shelf, names: Sequence[str]) -> None:
        self._shelf, self._names = shelf, names
        self._versions: list[tuple[str, int]] = []
        self._troubles = ui.element("div").props("role=status")
        self._list = ui.element("ul").classes("beside-list")
        with ui.element("section").classes("pane").props("aria-labelledby=h-heat"):
            Words("h2", "Where they pass").props("id=h-heat")
            self._heat = Heat("Tasks by prompts, run by run", "Task")
            Words(
                "p",
                "Percent of the completions of each prompt; the first column of a run is their mean.",
                "quiet",
            )
        with ui.element("section").classes("pane causes").props("aria-labelledby=h-kinds"):
            Words("h2", "Why they fail").props("id=h-kinds")
            self._kinds = Heat("Kinds of failures by run", "Kind of failure")
            Words("p", "Percent of all completions of a run.", "quiet")

    async def refresh(self) -> None:
        """Show what is known by now."""
        runs, troubles = await asyncio.to_thread(self._look)
        versions = [(seen.name, seen.version) for seen, _ in runs] + [(each, -1) for each in troubles]
        if versions == self._versions:
            return
        self._versions = versions
        heads = [seen.head for seen, _ in runs if seen.judged]
        if any(not is_same_suite(heads[0], head) for head in heads[1:]):
            troubles = [*troubles, ALIKE]
        self._troubles.clear()
        with self._troubles:
            for sentence in troubles:
                Words("p", sentence, "trouble")
        self._draw(runs)

    def _look(self) -> tuple[list[tuple[Seen, Suite | None]], list[str]]:
        runs, troubles = [], []
        for name in self._names:
            try:
                seen = self._shelf.open(name).look()
                runs.append((seen, self._shelf.suite_of(seen)))
            except BadInput as error:
                troubles.append(error.sentence)
        return runs, troubles

    def _draw(self, runs: Sequence[tuple[Seen, Suite | None]]) -> None:
        self._list.clear()
        with self._list:
            for seen, suite in runs:
                _draw_run(seen, run_data(seen, suite, ()))
        shades = [Shades(seen, suite, Wanted(), None) for seen, suite in runs]
        groups: list[dict[str, Any]] = []
        for (seen, _), one in zip(runs, shades, strict=True):
            name = shortened(seen.name, MOST_NAME)
            groups.append(
                {
                    "name": name,
                    "href": address(seen.name),
                    "told": title_of(seen),
                    "columns": columns(one.prompts, "all"),
                }
            )
        tasks = dict.fromkeys(task for one in shades for task in one.tasks)
        rows = [
            {
                "name": shortened(task, MOST_NAME),
                "cells": [cell for one in shades for cell in one.cells(task, one.prompts)],
            }
            for task in tasks
        ]
        self._heat.show(groups, rows)
        judged = [seen for seen, _ in runs if seen.judged]
        self._kinds.show(*(kinds_table(judged, lambda _: None) if judged else ([], [])))


def _draw_run(seen: Seen, told: dict[str, Any]) -> None:
    with ui.element("li"):
        html.a(shortened(seen.name, MOST_NAME), href=address(seen.name)).props("dir=auto")
        Words("small", str(told["state"]), f"state state-{str(told['state']).replace(' ', '-')}")
        Words("b", score_of(told))
        Words("span", f"{count_of(told)} completions, {title_of(seen)}", "quiet")
