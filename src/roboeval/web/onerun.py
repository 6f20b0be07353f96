"""The page of one run: how far it has come, where its programs fail and by what, and all of them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import Depends
from nicegui import html, ui

from codebotler.badinput import BadInput
from codebotler.terminal import shortened
from codebotler.web.frame import PATIENCE, Frame
from codebotler.web.words import Press, Words
from roboeval.suites.load import Suite
from roboeval.web.api import Choice, Evaluation
from roboeval.web.followed import FollowedRun, GoneError
from roboeval.web.overview import EVERY, GROWING, count_of, progress_of, score_of
from roboeval.web.parts import Heat, Rows, begin
from roboeval.web.seen import Seen, Wanted
from roboeval.web.shades import NONE, Shades, address, columns, percent, query_of, title_of
from roboeval.web.shelf import Shelf
from roboeval.web.telling import classes_of, run_data

MOST_NAME = 80
GONE = "This run is gone: its folder was deleted or renamed. What is below was read before."


def add(shelf: Shelf, frame: Frame) -> None:
    """Put the page at its address.

    Args:
        shelf: whose runs.
        frame: what all pages have.
    """

    @ui.page("/runs/{run}", response_timeout=PATIENCE)
    async def one_run(run: str, choice: Annotated[Choice, Depends()], evaluation: Evaluation = None) -> None:
        begin(frame, shortened(run, MOST_NAME))
        with ui.element("div").classes("benchmark"):
            try:
                followed = await asyncio.to_thread(shelf.open, run, evaluation)
                page = _RunPage(shelf, followed, choice.wanted, evaluation)
                await page.refresh()
            except BadInput as error:
                Words("p", error.sentence, "trouble").props("role=alert")
                html.a("All runs", href="/runs")
                return
        page.timer = ui.timer(EVERY, page.refresh, immediate=False)


class _RunPage:
    """A run on the page, kept in step with its folder."""

    def __init__(self, shelf: Shelf, followed: FollowedRun, wanted: Wanted, evaluation: str | None) -> None:
        self._shelf, self._followed, self._wanted, self._evaluation = shelf, followed, wanted, evaluation
        self._seen: Seen | None = None
        self._told: dict[str, Any] = {}
        self._changes = 0
        self._kinds: dict[Wanted, _Kind] = {}
        self.timer: ui.timer | None = None
        self._head = _Head(followed.run.path.name)
        with ui.element("div").classes("findings"):
            with ui.element("section").classes("pane").props("aria-labelledby=h-heat"):
                self._title = Words("h2", "").props("id=h-heat")
                self._heat = Heat("Tasks by prompts", "Task", self._choose_cell)
                Words(
                    "p", "Percent of the completions of each prompt; the first column is their mean.", "quiet"
                )
            with ui.element("section").classes("pane ends").props("aria-labelledby=h-kinds"):
                Words("h2", "How they end").props("id=h-kinds")
                self._ends = ui.element("div").classes("kinds")
            with ui.element("section").classes("pane list").props("id=completions aria-labelledby=h-list"):
                with ui.element("div").classes("head"):
                    self._which = Words("h2", "").props("id=h-list")
                    self._all = Press("Show all", lambda: self._choose(Wanted()), "plain small")
                self._rows = Rows(address(followed.run.path.name))

    async def refresh(self) -> None:
        """Show what is known by now.

        Raises:
            GoneError: the run is not there any more, and never was on this page.
        """
        try:
            seen, told, suite = await asyncio.to_thread(self._look)
        except GoneError:
            if self._seen is None:
                raise
            self._head.trouble(GONE)
            if self.timer is not None:
                self.timer.deactivate()
            return
        if seen != self._seen:
            self._seen = seen
            self._told = told
            self._changes += 1
            self._draw(suite)

    def _look(self) -> tuple[Seen, dict[str, Any], Suite | None]:
        # anew each time: what was only being generated may have an evaluation by now
        self._followed = self._shelf.open(self._name, self._evaluation)
        seen = self._followed.look()
        suite = self._shelf.suite_of(seen)
        return seen, run_data(seen, suite, self._shelf.evaluations(seen.name)), suite

    def _draw(self, suite: Suite | None) -> None:
        seen = self._seen
        assert seen is not None, "it was just looked at"
        self._head.show(seen, self._told, self._evaluation)
        self._suite = suite
        self._show_choice()

    def _choose_cell(self, task: str, prompt: int | None) -> None:
        self._choose(replace(self._wanted, task=task, prompt=prompt))

    def _choose(self, wanted: Wanted) -> None:
        self._wanted = wanted
        ui.navigate.history.replace(address(self._name) + query_of(wanted, self._evaluation))
        self._show_choice()

    @property
    def _name(self) -> str:
        return self._followed.run.path.name

    def _show_choice(self) -> None:
        seen, wanted = self._seen, self._wanted
        assert seen is not None, "it was looked at before"
        shades = Shades(seen, self._suite, wanted, self._evaluation)
        rows = [
            {"name": shortened(task, MOST_NAME), "cells": shades.cells(task, shades.prompts)}
            for task in shades.tasks
        ]
        self._heat.show([{"name": "", "columns": columns(shades.prompts, "all")}], rows)
        self._title.say(f"Where they {_word(wanted)}")
        self._which.say(_said(wanted))
        self._all.set_visibility(wanted != Wanted())
        query = query_of(wanted, self._followed.key)
        source = f"/api/runs/{quote(self._name, safe='')}/completions{query or '?'}"
        self._rows.show(source, query_of(wanted, self._evaluation), self._changes)
        self._show_kinds(seen)

    def _show_kinds(self, seen: Seen) -> None:
        of = len(seen.judged)
        counts = {Wanted(): ("all that were judged", of), Wanted(passed=True): ("passed", seen.passed_count)}
        for name, count, kinds in classes_of(seen):
            counts[Wanted(failure_class=name)] = (name, count)
            counts |= {Wanted(failure_class=name, kind=kind): (kind, each) for kind, each in kinds}
        if list(self._kinds) != list(counts):
            self._ends.clear()
            with self._ends:
                self._kinds = {
                    wanted: _Kind(name, wanted, self._choose_kind) for wanted, (name, _) in counts.items()
                }
        for wanted, (_, count) in counts.items():
            self._kinds[wanted].show(count, of, is_here=wanted == self._wanted.of_any_place)

    def _choose_kind(self, wanted: Wanted) -> None:
        self._choose(replace(wanted, task=self._wanted.task, prompt=self._wanted.prompt))


class _Kind:
    """A way in which programs end, to be chosen."""

    def __init__(self, name: str, wanted: Wanted, chosen: Callable[[Wanted], None]) -> None:
        look = "kind of-class" if wanted.kind is not None else "kind"
        look += " bad-kind" if wanted.failure_class is not None else ""
        with Press("", lambda: chosen(wanted), look) as self._button:
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
            self._who = Words("span", "")
            self._score = Words("b", "")
            self._count = Words("span", "")
        self._bar = html.progress(max="1").classes("long")
        self._bar.props["aria-label"] = "How far it has come"
        self._notes = ui.element("ul").classes("notes")
        self._trouble = Words("p", "", "trouble").props("role=alert")
        self._others = ui.element("p").classes("facts")
        self._trouble.say("")

    def trouble(self, sentence: str) -> None:
        """Say what is amiss."""
        self._trouble.say(sentence)

    def show(self, seen: Seen, told: dict[str, Any], evaluation: str | None) -> None:
        """Show how far the run has come."""
        state = str(told["state"])
        self._state.say(state)
        self._state.classes(replace=f"state state-{state.replace(' ', '-')}")
        self._who.say(
            f"{title_of(seen)}, judged by {shortened(seen.key, MOST_NAME)}" if seen.key else title_of(seen)
        )
        self._score.say(score_of(told))
        self._count.say(f"{count_of(told)} completions")
        done, of = progress_of(told)
        self._bar.set_visibility(told["state"] in GROWING)
        self._bar.props(f"value={done / of if of else 0:.3f}")
        self._notes.clear()
        with self._notes:
            for sentence in told["notes"]:
                Words("li", sentence, "unsure")
        self._others.clear()
        with self._others:
            for other in told["evaluations"] if len(told["evaluations"]) > 1 else ():
                link = html.a(
                    shortened(other, MOST_NAME), href=address(seen.name) + query_of(Wanted(), other)
                )
                if other == (evaluation or told["evaluation"]):
                    link.props('aria-current="true"')


def _word(wanted: Wanted) -> str:
    if wanted.kind or wanted.failure_class:
        return f"fail by {shortened(wanted.kind or wanted.failure_class or '', MOST_NAME)}"
    return "fail" if wanted.passed is False else "pass"


def _said(wanted: Wanted) -> str:
    """Which completions are listed, in words."""
    parts = ["Completions"]
    if wanted.task is not None:
        parts.append(f"of {shortened(wanted.task, MOST_NAME)}")
    if wanted.prompt is not None:
        parts.append(f"prompt {wanted.prompt}")
    if wanted.passed is not None or wanted.failure_class or wanted.kind:
        passed = wanted.passed
        parts.append("that passed" if passed else f"that {_word(wanted).replace('fail', 'failed', 1)}")
    head, *rest = parts
    return ", ".join([" ".join([head, *rest[:1]]), *rest[1:]])
