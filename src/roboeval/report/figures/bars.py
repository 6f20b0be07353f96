"""Draws figures of pass@1 by run and by task, and of the causes of failures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from roboeval.analysis.counting.summary import ALL, PASSED, Causes, kinds_in_order
from roboeval.analysis.metrics import TaskScore, overall, percent
from roboeval.evaluation.judging.failures import FAILURE_CLASSES, NO_PROGRAM_CLASS, classes_to_show, plural_of
from roboeval.report.figures.drawing import (
    BACKGROUND,
    COLOURS,
    FOREGROUND,
    MAX_LEGEND_NAME,
    MUTED,
    PAGE_WIDTH,
    PALE,
    new_figure,
    shades,
    share_axis,
    short_name,
)
from roboeval.report.runs import JudgedRun, tasks_of

HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "----", "", "++++")  # distinguish bars in print
TASKS_PER_ROW = 8
MIN_TASK_SLOTS = 4  # minimum width in tasks, so that a single bar does not fill the page
BAR_FILL = 0.82  # share of a task's width that its bars fill
MAX_PANELS_PER_ROW = 3  # leaves enough room for the labels between panels
DARK_CELL_SHARE = 0.75  # cells with a larger share have white text

# --- pass@1 by run, and by task


def draw_overall(runs: Sequence[JudgedRun]) -> Figure:
    """Draw a bar for each run: its mean pass@1, with a 95% confidence interval over tasks."""
    figure = new_figure(PAGE_WIDTH, 0.62 + 0.21 * len(runs))
    axes = figure.add_subplot()
    for at, run in enumerate(runs):
        passed = overall(run.scores, 1)
        axes.barh(at, passed.mean, 0.6, color=COLOURS[0], linewidth=0)
        if passed.is_known:
            ends = [[passed.mean - passed.low], [passed.high - passed.mean]]
            axes.errorbar(passed.mean, at, xerr=ends, **_whisker(2.5))
        label = f"{passed.mean:.3f}  ({passed.ends()})"
        axes.text(1.02, at, label, transform=axes.get_yaxis_transform(), va="center", fontsize=7)
    axes.set_yticks(range(len(runs)), [short_name(run.name, 34) for run in runs])
    axes.set_ylim(len(runs) - 0.5, -0.5)
    axes.tick_params(axis="y", left=False, length=0)
    axes.set_xlim(0, 1)
    axes.set_xticks([0, 0.25, 0.5, 0.75, 1])
    axes.grid(visible=True, axis="x")
    axes.set_xlabel("pass@1 over all prompts, with 95% confidence intervals over tasks")
    return figure


def _whisker(cap: float) -> dict[str, Any]:
    return {"fmt": "none", "elinewidth": 0.7, "capsize": cap, "capthick": 0.7, "ecolor": FOREGROUND}


def draw_task_scores(runs: Sequence[JudgedRun]) -> Figure:
    """Draw bars of pass@1 by task and run. A second panel shows pass@1 on common sense only, if judged."""
    tasks = tasks_of(runs)
    judged = {score.task for run in runs for score in run.ablated_scores}
    ablated = [task for task in runs[0].suite.tasks if task in judged]
    lines = math.ceil(len(tasks) / TASKS_PER_ROW)
    sides = [("(a) all requirements", [run.scores for run in runs], _in_lines(tasks, lines))]
    if ablated:
        ablated_scores = [run.ablated_scores for run in runs]
        sides.append(("(b) common sense only", ablated_scores, _in_lines(ablated, lines)))
    widths = [len(sides[0][2][0]), *([max(2, len(ablated) / lines)] if ablated else [])]
    figure = new_figure(PAGE_WIDTH, 1.75 * lines + 0.45)
    grid = figure.add_gridspec(lines, len(sides), width_ratios=widths)
    for column, (title, scores, rows) in enumerate(sides):
        room = max(len(rows[0]), 0 if column else MIN_TASK_SLOTS)
        for row, those in enumerate(rows):
            axes = figure.add_subplot(grid[row, column])
            _bars_on(axes, scores, those, room)
            axes.set_ylabel("" if column else "pass@1")
            axes.set_title(title if ablated and not row else "", loc="left")
    names = [short_name(run.name) for run in runs]
    handles: list[Artist] = [
        Patch(facecolor=colour, hatch=hatch, edgecolor=BACKGROUND, label=name)
        for colour, hatch, name in zip(COLOURS, HATCHES, names, strict=False)
    ]
    if any(len(score.prompts) > 1 for run in runs for score in (*run.scores, *run.ablated_scores)):
        handles.append(Line2D([], [], label=WORST_AND_BEST, **_mark(2.6)))
    columns = min(len(handles), 5 if max(map(len, names)) <= MAX_LEGEND_NAME else 3)
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, handlelength=1.0)
    return figure


def _in_lines(tasks: Sequence[str], lines: int) -> list[Sequence[str]]:
    each = math.ceil(len(tasks) / lines)
    return [tasks[start : start + each] for start in range(0, len(tasks), each)]


def _bars_on(axes: Axes, scores: Sequence[Sequence[TaskScore]], tasks: Sequence[str], room: int) -> None:
    width = BAR_FILL / len(scores)
    for number, those in enumerate(scores):
        bars = [
            (tasks.index(score.task) + (number + 0.5) * width - BAR_FILL / 2, score, score.pass_at(1))
            for score in those
            if score.task in tasks
        ]
        look: dict[str, Any] = {"color": COLOURS[number], "hatch": HATCHES[number], "edgecolor": BACKGROUND}
        axes.bar([at for at, *_ in bars], [one.mean for *_, one in bars], width * 0.92, linewidth=0, **look)
        known = [(at, one) for at, _, one in bars if one.is_known]
        if known:
            ends = [[one.mean - one.low for _, one in known], [one.high - one.mean for _, one in known]]
            places, means = [at for at, _ in known], [one.mean for _, one in known]
            axes.errorbar(places, means, yerr=ends, **_whisker(min(2.5, 14 * width)))
        several = [(at, score) for at, score, _ in bars if len(score.prompts) > 1]
        if marks := [(at, end) for at, score in several for end in {score.lowest(1), score.highest(1)}]:
            axes.plot(*zip(*marks, strict=True), **_mark(min(2.6, 20 * width)))
        if zeros := [at for at, _, one in bars if one.mean == 0]:
            axes.plot(zeros, [0] * len(zeros), "o", color=COLOURS[number], markersize=2.2, clip_on=False)
    margin = (room - len(tasks)) / 2 if len(tasks) < MIN_TASK_SLOTS else 0
    axes.set_xlim(-0.5 - margin, room - 0.5 - margin)
    axes.set_ylim(0, 1.03)
    axes.set_yticks([0, 0.5, 1])
    axes.grid(visible=True, axis="y")
    axes.set_xticks(range(len(tasks)), [_two_lines(task) for task in tasks])
    axes.tick_params(axis="x", bottom=False, length=0, labelsize=6.5 if room > 6 else 7)  # noqa: PLR2004 - smaller labels for many tasks


WORST_AND_BEST = "worst and best prompt"


def _mark(size: float) -> dict[str, Any]:
    edge = {"markerfacecolor": BACKGROUND, "markeredgecolor": FOREGROUND, "markeredgewidth": 0.5}
    return {"linestyle": "none", "marker": "D", "markersize": size, "clip_on": False, "zorder": 4, **edge}


def _two_lines(task: str) -> str:
    """Break the name of a task into two lines before its last capital letter."""
    last = max((at for at, letter in enumerate(task) if letter.isupper()), default=0)
    return "\n".join(short_name(part, 14) for part in (task[:last], task[last:]) if part)


# --- tables of shares


def draw_heat_map(
    axes: Axes, cells: Sequence[Sequence[float]], rows: Sequence[str], columns: Sequence[str]
) -> None:
    """Draw shares from 0 to 1 as a heat map with percentages. `rows` and `columns` are its labels."""
    axes.pcolormesh(np.array(cells), cmap=shades(), vmin=0, vmax=1, edgecolors=BACKGROUND, linewidth=0.6)
    axes.invert_yaxis()
    middles = [at + 0.5 for at in range(max(len(rows), len(columns)))]
    axes.set_xticks(middles[: len(columns)], columns, rotation=38, ha="right", rotation_mode="anchor")
    axes.set_yticks(middles[: len(rows)], rows)
    axes.tick_params(left=False, bottom=False, length=0)
    axes.spines[:].set_color(PALE)
    axes.spines[:].set_visible(True)
    for y, shares in zip(middles, cells, strict=False):
        for x, share in zip(middles, shares, strict=False):
            colour = MUTED if share == 0 else FOREGROUND if share < DARK_CELL_SHARE else BACKGROUND
            cell = axes.text(x, y, percent(share), ha="center", va="center", color=colour, fontsize=6)
            cell.set_in_layout(False)  # the text is inside the axes, so layout may ignore it


def draw_causes(found: Sequence[tuple[str, Causes]]) -> Figure:
    """Draw the outcomes of runs and the kinds of failure in each class, given pairs of a name and causes."""
    happened = {name for _, one in found for name, share in one.classes.items() if share}
    shown = classes_to_show(happened)
    kinds = {name: kinds_in_order([one for _, one in found], name) for name in shown}
    tallest = max(3, *map(len, kinds.values()))
    longest = max(len(short_name(name, 18)) for name, _ in found)
    # Leave room below the panels for the slanted names of models.
    below = 0.95 + 0.155 * tallest + 0.04 * max(0, longest - 8)
    columns = len(shown) if len(shown) <= MAX_PANELS_PER_ROW else 2
    lines = math.ceil(len(shown) / columns)
    heights = [1.05 + 0.2 * len(found), below * lines]
    figure = new_figure(PAGE_WIDTH, sum(heights))
    upper, lower = figure.subfigures(2, 1, height_ratios=heights, squeeze=False)[:, 0]
    axes = upper.add_subplot()
    _classes(axes, found, shown)
    legend = {"ncols": max(4, 1 + len(shown)), "handlelength": 1.4}
    upper.legend(*axes.get_legend_handles_labels(), loc="outside lower center", **legend)
    panels = lower.subplots(lines, columns, squeeze=False).flat
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    for axes, letter, name in zip(panels, "bcdefgh", shown, strict=False):
        axes.set_title(f"({letter}) {plural_of(name)}", loc="left")
        _kinds(axes, found, name, kinds[name])
    return figure


def _classes(axes: Axes, found: Sequence[tuple[str, Causes]], shown: Sequence[str]) -> None:
    axes.set_title("(a) outcomes of completions", loc="left")
    left = np.zeros(len(found))
    places = range(len(found))
    looks = _looks()
    for name in (PASSED, *shown):
        colour, hatch = looks[name]
        shares = np.array([one.classes.get(name, 0.0) for _, one in found])
        style: dict[str, Any] = {"color": colour, "hatch": hatch, "edgecolor": BACKGROUND, "linewidth": 0.4}
        label = name if name == PASSED else plural_of(name)
        axes.barh(places, shares, 0.72, left=left, label=label, **style)
        left = left + shares
    axes.set_yticks(places, [short_name(name, 34) for name, _ in found])
    axes.set_ylim(len(found) - 0.5, -0.5)
    axes.tick_params(axis="y", left=False, length=0)
    share_axis(axes, along="x")


def _looks() -> dict[str, tuple[str, str]]:
    """Map each outcome to a colour and a hatch. Those of the paper's classes are always the same."""
    others = [name for name in FAILURE_CLASSES if name != NO_PROGRAM_CLASS]
    colours = cycle(COLOURS[at] for at in (1, 0, 3, 2, 4, 5))
    hatches = cycle(("", "////", "\\\\\\\\", "....", ""))
    looks = zip(others, zip(colours, hatches, strict=False), strict=False)
    return {PASSED: (PALE, ""), NO_PROGRAM_CLASS: (MUTED, ""), **dict(looks)}


def _kinds(axes: Axes, found: Sequence[tuple[str, Causes]], cause: str, kinds: Sequence[str]) -> None:
    shown_runs = [(short_name(name, 18), one) for name, one in found if one.kinds.get(cause)]
    if not kinds:
        axes.text(0.5, 0.5, "none", ha="center", va="center", transform=axes.transAxes)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    cells = [[one.kinds[cause].get(kind, 0.0) for _, one in shown_runs] for kind in kinds]
    names = [
        name if (count := one.counts.get((cause, ALL))) is None else f"{name} (n = {count:,})"
        for name, one in shown_runs
    ]
    draw_heat_map(axes, cells, [short_name(kind, 24) for kind in kinds], names)
