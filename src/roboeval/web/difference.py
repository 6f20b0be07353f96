"""Compares pairs of runs, and a single pair also by task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import urlencode

from nicegui import html, ui

from codebotler.core.errors import UserError
from codebotler.core.terminal import shortened
from codebotler.web.frame import PlainText, outside
from roboeval.analysis.compare import (
    MISSIONS_COMPARED,
    Comparison,
    compare_tables,
    comparison_sentence,
    pairs_to_compare,
)
from roboeval.analysis.metrics import Estimate
from roboeval.analysis.missions import has_missions
from roboeval.web.heat_map import MAX_NAME
from roboeval.web.snapshot import Snapshot

RUNS_IN_PAIR = 2
INTERVAL_NOTE = "The interval for all tasks is over tasks; other intervals are over the prompts of a task."


@dataclass(frozen=True)
class Difference:
    """The difference between two judged runs."""

    runs: tuple[Snapshot, Snapshot]
    sentence: str  # states which run is better, and how significant the difference is
    comparison: Comparison | None = None  # None if they have no prompt in common


def differences_of(runs: Sequence[Snapshot]) -> list[Difference]:
    """Compare pairs of judged runs. For large runs, this may take seconds."""
    pairs = pairs_to_compare(runs, lambda run: 0.0 if run.pass_at_1 is None else run.pass_at_1.mean)
    return [_difference(*pair) for pair in pairs]


def _difference(first: Snapshot, second: Snapshot) -> Difference:
    names = shortened(first.name, MAX_NAME), shortened(second.name, MAX_NAME)
    tables = first.results.table, second.results.table
    try:
        found = compare_tables(*tables)
    except UserError:
        return Difference((first, second), f"{names[0]} and {names[1]} have no prompt in common.")
    sentence = comparison_sentence(found, names)
    if len({has_missions(table) for table in tables}) > 1:
        sentence += f" {MISSIONS_COMPARED[0].upper()}{MISSIONS_COMPARED[1:]}."
    return Difference((first, second), sentence, found)


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
    names = [shortened(run.name, MAX_NAME) for run in difference.runs]
    PlainText("p", difference.sentence)
    found = difference.comparison
    if found is None:
        return
    tasks = sorted(found.tasks, key=lambda one: (-abs(one.difference.mean), one.task))
    region = ui.element("div").classes("sideways").props('tabindex=0 role=region aria-label="Differences"')
    with region, html.table().classes("differences"):
        with html.thead(), html.tr():
            heads = "Task", *names, f"{names[1]} \N{MINUS SIGN} {names[0]}", "95% confidence interval"
            for head in heads:
                PlainText("th", head).props("scope=col")
        with html.tbody():
            _draw_row("All tasks", (found.first, found.second), found.over_tasks)
            for one in tasks:
                _draw_row(one.task, (one.first, one.second), one.difference)
    PlainText("p", INTERVAL_NOTE, "quiet")


def _draw_row(task: str, shares: tuple[float, float], difference: Estimate) -> None:
    with html.tr():
        PlainText("th", shortened(task, MAX_NAME)).props("scope=row")
        for share in shares:
            PlainText("td", f"{share:.2f}", "number")
        PlainText("td", f"{difference.mean:+.2f}", "number strong")
        PlainText("td", difference.ends("+.2f"), "number")
