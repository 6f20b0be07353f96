"""The page of all runs: who wrote each, how far it has come, and how often its programs pass."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from nicegui import html, ui

from codebotler.badinput import BadInput
from codebotler.pasted import runnable
from codebotler.terminal import shortened
from codebotler.web.frame import PATIENCE, Frame
from codebotler.web.words import Press, Words
from roboeval.web.parts import begin
from roboeval.web.shades import NONE, address
from roboeval.web.shelf import Shelf
from roboeval.web.telling import State, run_data

EVERY = 1.0
"""Seconds after which the page looks whether something has changed."""

READ_FOR = 0.5
"""Seconds that one look reads at most, of all runs together."""

ORDERS: Mapping[str, Callable[[Mapping[str, Any]], tuple[float, str]]] = {
    "Run": lambda told: (0, str(told["run"]).lower()),
    "pass@1": lambda told: (-(told.get("pass@1") or {"mean": -1})["mean"], str(told["run"])),
    "Completions": lambda told: (-told.get("completions", 0), str(told["run"])),
}
SORTED = {"Run": "ascending", "pass@1": "descending", "Completions": "descending"}
GROWING = {State.READING, State.GENERATING, State.JUDGING}
NOTHING = "There is no run here yet. The first one, without a key or a network:"
FIRST = "run --model recorded:hasty --num-completions 3"
MOST_NAME = 80


def add(shelf: Shelf, frame: Frame) -> None:
    """Put the page at its address.

    Args:
        shelf: whose runs.
        frame: what all pages have.
    """

    @ui.page("/runs", response_timeout=PATIENCE)
    async def list_runs() -> None:
        begin(frame, "Runs")
        with ui.element("div").classes("benchmark"):
            Words("h1", "Runs")
            Words("p", f"In {shortened(str(shelf.folder.resolve()), 200)}", "quiet")
            table = _Table(shelf)
        await table.refresh()
        ui.timer(EVERY, table.refresh, immediate=False)


def looked_at(shelf: Shelf) -> list[dict[str, Any]]:
    """What is known of all runs by now; of one that cannot be read, why.

    Raises:
        BadInput: the folder cannot be read.
    """
    until = time.monotonic() + READ_FOR
    found = []
    for name in shelf.names():
        try:
            seen = shelf.open(name).look(max(0.0, until - time.monotonic()))
            found.append(run_data(seen, shelf.suite_of(seen), shelf.evaluations(name)))
        except BadInput as error:
            found.append({"run": name, "state": "not read", "notes": [str(error)]})
    return found


class _Table:
    """The runs as rows of a table."""

    def __init__(self, shelf: Shelf) -> None:
        self._shelf = shelf
        self._order = "Run"
        self._heads: dict[str, ui.element] = {}
        self._told: list[dict[str, Any]] = []
        self._rows: list[_Row] = []
        self._trouble = Words("p", "", "trouble").props("role=alert")
        self._empty = ui.element("div").classes("first-run")
        with self._empty:
            Words("p", NOTHING, "quiet")
            Words("pre", f"{runnable('roboeval')} {FIRST}", "source").props("tabindex=0")
        self._form = ui.element("form").props("action=/side-by-side method=get")
        with self._form:
            with (
                ui.element("div").classes("sideways").props('tabindex=0 role=region aria-label="Runs"'),
                html.table().classes("runs"),
            ):
                with html.thead(), html.tr():
                    with html.th().props("scope=col").classes("tick"):
                        Words("span", "Side by side", "unseen")
                    for name in ("Run", "Suite", "State", "Completions", "pass@1"):
                        self._head(name)
                self._body = html.tbody()
            html.button("Show side by side", type="submit").classes("plain")
        self._trouble.say("")

    def _head(self, name: str) -> None:
        with html.th().props("scope=col") as cell:
            if name in ORDERS:
                Press(name, lambda: self._sort(name), "sort")
                self._heads[name] = cell
            else:
                Words("span", name)

    def _sort(self, name: str) -> None:
        self._order = name
        self._draw(self._told)

    async def refresh(self) -> None:
        """Show what is known by now."""
        try:
            told = await asyncio.to_thread(looked_at, self._shelf)
        except BadInput as error:
            self._trouble.say(str(error))
            return
        self._trouble.say("")
        self._draw(told)

    def _draw(self, told: Sequence[dict[str, Any]]) -> None:
        ordered = sorted(told, key=ORDERS[self._order])
        for name, head in self._heads.items():
            head.props(f"aria-sort={SORTED[name] if name == self._order else 'none'}")
        self._told = ordered
        self._empty.set_visibility(not ordered)
        self._form.set_visibility(bool(ordered))
        if [row.name for row in self._rows] != [one["run"] for one in ordered]:
            self._body.clear()
            with self._body:
                self._rows = [_Row(one["run"]) for one in ordered]
        for row, one in zip(self._rows, ordered, strict=True):
            row.show(one)


class _Row:
    """A run as a row of the table."""

    def __init__(self, name: str) -> None:
        self.name = name
        with html.tr():
            with html.td().classes("tick"):
                box = ui.element("input").props("type=checkbox name=run")
                box.props["value"] = name
                box.props["aria-label"] = f"Show {shortened(name, MOST_NAME)} side by side with others"
            with html.th().props("scope=row"):
                with html.a(href=address(name)):
                    Words("b", shortened(name, MOST_NAME))
                self._who = Words("span", "", "quiet")
                self._notes = Words("span", "", "bad note")
            with html.td():
                self._suite = Words("span", "")
            with html.td():
                self._state = Words("small", "")
                self._bar = html.progress(max="1")
            with html.td().classes("count"):
                self._count = Words("span", "")
            with html.td().classes("score"):
                self._score = Words("b", "")
                self._interval = Words("span", "", "quiet")
                self._meter = ui.element("span").classes("meter").props("aria-hidden=true")

    def show(self, told: Mapping[str, Any]) -> None:
        """Show what is known of it."""
        models = told.get("models", [])
        by_hand = ", programs written by hand" if told.get("by_hand") else ""
        self._who.say(shortened(", ".join(models), 160) + by_hand)
        self._notes.say(" ".join(told["notes"][:1]))
        self._suite.say(shortened(str(told.get("evaluation") or told.get("suite") or NONE), MOST_NAME))
        self._state.say(str(told["state"]))
        self._state.classes(replace=f"state state-{str(told['state']).replace(' ', '-')}")
        done, of = progress_of(told)
        self._bar.set_visibility(told["state"] in GROWING)
        self._bar.props(f"value={done / of if of else 0:.3f}").props["aria-label"] = f"{done:,} of {of:,}"
        self._count.say(count_of(told))
        mean = told.get("pass@1")
        self._score.say(NONE if mean is None else f"{mean['mean']:.3f}")
        self._interval.say("" if mean is None else f"{mean['low']:.2f} to {mean['high']:.2f}")
        self._meter.set_visibility(mean is not None)
        self._meter.style(f"--share: {0 if mean is None else mean['mean']:.3f}")


def progress_of(told: Mapping[str, Any]) -> tuple[int, int]:
    """How far a run has come: how many, of how many."""
    match told["state"]:
        case State.READING:
            return round(100 * told["read"]), 100
        case State.GENERATING:
            return told["completions"], told["wanted"] or 0
        case State.JUDGING:
            return told["judged"], told["to_judge"]
    return told.get("judged", 0), told.get("to_judge", 0)


def count_of(told: Mapping[str, Any]) -> str:
    """How many completions there are, and of how many, where some are missing."""
    if "completions" not in told:
        return NONE
    written, wanted, judged = told["completions"], told["wanted"], told["judged"]
    if wanted is not None and written < wanted:
        return f"{written:,} of {wanted:,} written"
    if judged < told["to_judge"]:
        return f"{judged:,} of {told['to_judge']:,} judged"
    return f"{judged or written:,}"


def score_of(told: Mapping[str, Any]) -> str:
    """How often its programs pass, in words; nothing where nobody knows."""
    mean = told.get("pass@1")
    if mean is None:
        return ""
    return f"pass@1 {mean['mean']:.3f} (95% interval {mean['low']:.2f} to {mean['high']:.2f})"
