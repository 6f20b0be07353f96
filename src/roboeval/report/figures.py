"""The figures of a report: pass@1 of each run, and those of sections V and VI of the paper."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any, TypeAlias

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import TICKDOWN
from matplotlib.patches import Patch

from roboeval.analysis.metrics import Estimate, TaskScore, overall, threshold_curve
from roboeval.analysis.resample import LIMITS
from roboeval.analysis.summary import ALL, PASSED, Causes, kinds_in_order
from roboeval.evaluation.failures import FAILURE_CLASSES, NO_PROGRAM_CLASS, classes_to_show, plural_of
from roboeval.report.drawing import (
    COLOURS,
    DASHES,
    FAINT,
    INK,
    MARKERS,
    NARROW,
    PAPER,
    QUIET,
    WHITE,
    WIDE,
    new_figure,
    shades,
    share_axis,
    short_name,
)
from roboeval.report.runs import JudgedRun, tasks_of

MOST_COLOURS = len(COLOURS)
POWERS = (0.1, 0.01, 0.001)  # labelled on an axis of thresholds
SHORT_AXIS, BETWEEN = 20, (0.5, 0.2)  # more labels, if prompts have at most 20 completions
APART = 1.6  # smallest ratio of two labels that do not overlap
HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "----", "", "++++")  # distinguish bars without colours
A_ROW = 8  # tasks per row
FEWEST = 4  # leave room for this many tasks, so that a single bar does not fill the page
SHORT_NAME = 16  # letters; two names of this length fit side by side below a narrow figure
BAR = 0.82  # share of a task's width that its bars fill
MOST_PANELS = 3  # panels side by side with labels between them
MOST_NUMBERS = 14  # rows or columns; cells of larger tables have no numbers
DARK_FROM = 0.75  # cells with larger shares need white text

Points: TypeAlias = Sequence[tuple[float, float]]
Cells: TypeAlias = Sequence[Sequence[float | None]]


# --- pass@1 by run, and by task


def overall_scores(runs: Sequence[JudgedRun]) -> Figure:
    """Draw pass@1 of each run over all prompts, with its interval over tasks."""
    figure = new_figure(WIDE, 0.62 + 0.21 * len(runs))
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
    return {"fmt": "none", "elinewidth": 0.7, "capsize": cap, "capthick": 0.7, "ecolor": INK}


def bars(runs: Sequence[JudgedRun]) -> Figure:
    """Draw pass@1 by task and model, with intervals over prompts, and next to it the ablated tasks."""
    tasks = tasks_of(runs)
    there = {score.task for run in runs for score in run.ablated_scores}
    ablated = [task for task in runs[0].suite.tasks if task in there]
    if len(runs) > MOST_COLOURS:
        return _heat_of_tasks(runs, tasks, ablated)
    lines = math.ceil(len(tasks) / A_ROW)
    sides = [("(a) all requirements", [run.scores for run in runs], _in_lines(tasks, lines))]
    if ablated:
        ablated_scores = [run.ablated_scores for run in runs]
        sides.append(("(b) common sense only", ablated_scores, _in_lines(ablated, lines)))
    widths = [len(sides[0][2][0]), *([max(2, len(ablated) / lines)] if ablated else [])]
    figure = new_figure(WIDE, 1.75 * lines + 0.45)
    grid = figure.add_gridspec(lines, len(sides), width_ratios=widths)
    for column, (title, scores, rows) in enumerate(sides):
        room = max(len(rows[0]), 0 if column else FEWEST)
        for row, those in enumerate(rows):
            axes = figure.add_subplot(grid[row, column])
            _bars_on(axes, scores, those, room)
            axes.set_ylabel("" if column else "pass@1")
            axes.set_title(title if ablated and not row else "", loc="left")
    names = [short_name(run.name) for run in runs]
    handles: list[Artist] = [
        Patch(facecolor=colour, hatch=hatch, edgecolor=PAPER, label=name)
        for colour, hatch, name in zip(COLOURS, HATCHES, names, strict=False)
    ]
    if any(len(score.prompts) > 1 for run in runs for score in (*run.scores, *run.ablated_scores)):
        handles.append(Line2D([], [], label=WORST_AND_BEST, **_mark(2.6)))
    columns = min(len(handles), 5 if max(map(len, names)) <= SHORT_NAME else 3)
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, handlelength=1.0)
    return figure


def _in_lines(tasks: Sequence[str], lines: int) -> list[Sequence[str]]:
    each = math.ceil(len(tasks) / lines)
    return [tasks[start : start + each] for start in range(0, len(tasks), each)]


def _bars_on(axes: Axes, scores: Sequence[Sequence[TaskScore]], tasks: Sequence[str], room: int) -> None:
    width = BAR / len(scores)
    for number, those in enumerate(scores):
        there = [(tasks.index(score.task), score) for score in those if score.task in tasks]
        places = [at + (number + 0.5) * width - BAR / 2 for at, _ in there]
        passed = [score.pass_at(1) for _, score in there]
        means = [one.mean for one in passed]
        known = [one if one.is_known else Estimate(one.mean, one.mean, one.mean) for one in passed]
        ends = [[one.mean - one.low for one in known], [one.high - one.mean for one in known]]
        look: dict[str, Any] = {"color": COLOURS[number], "hatch": HATCHES[number], "edgecolor": PAPER}
        axes.bar(places, means, width * 0.92, linewidth=0, **look)
        shown = [at for at, one in enumerate(passed) if one.is_known]
        if shown:
            whiskers = [[of[at] for at in shown] for of in ends]
            where = [places[at] for at in shown], [means[at] for at in shown]
            axes.errorbar(*where, yerr=whiskers, **_whisker(min(2.5, 14 * width)))
        several = [
            (place, one) for place, (_, one) in zip(places, there, strict=True) if len(one.prompts) > 1
        ]
        marks = [(place, end) for place, one in several for end in {one.lowest(1), one.highest(1)}]
        if marks:
            axes.plot(*zip(*marks, strict=True), **_mark(min(2.6, 20 * width)))
        zeros = [place for place, mean in zip(places, means, strict=True) if mean == 0]
        if zeros:
            axes.plot(zeros, [0] * len(zeros), "o", color=COLOURS[number], markersize=2.2, clip_on=False)
    margin = (room - len(tasks)) / 2 if len(tasks) < FEWEST else 0
    axes.set_xlim(-0.5 - margin, room - 0.5 - margin)
    axes.set_ylim(0, 1.03)
    axes.set_yticks([0, 0.5, 1])
    axes.grid(visible=True, axis="y")
    axes.set_xticks(range(len(tasks)), [_two_lines(task) for task in tasks])
    axes.tick_params(axis="x", bottom=False, length=0, labelsize=6.5 if room > 6 else 7)  # noqa: PLR2004 - smaller labels for many tasks


WORST_AND_BEST = "worst and best prompt"


def _mark(size: float) -> dict[str, Any]:
    """The style of a diamond that marks a prompt."""
    edge = {"markerfacecolor": PAPER, "markeredgecolor": INK, "markeredgewidth": 0.5}
    return {"linestyle": "none", "marker": "D", "markersize": size, "clip_on": False, "zorder": 4, **edge}


def _two_lines(task: str) -> str:
    """Break the name of a task before its last capital letter."""
    last = max((at for at, letter in enumerate(task) if letter.isupper()), default=0)
    return "\n".join(short_name(part, 14) for part in (task[:last], task[last:]) if part)


def _heat_of_tasks(runs: Sequence[JudgedRun], tasks: Sequence[str], ablated: Sequence[str]) -> Figure:
    """Draw pass@1 by task as a heat map with a row per model, if there are more models than colours."""
    figure = new_figure(WIDE, 1.3 + 0.16 * len(runs))
    widths = [len(tasks), *([len(ablated)] if ablated else [])]
    grid = figure.add_gridspec(1, len(widths), width_ratios=widths)
    names = [short_name(run.name) for run in runs]
    heat(figure.add_subplot(grid[0, 0]), [_means(run.scores, tasks) for run in runs], names, tasks)
    if ablated:
        axes = figure.add_subplot(grid[0, 1])
        cells = [_means(run.ablated_scores, ablated) for run in runs]
        heat(axes, cells, [""] * len(runs), ablated)
        axes.set_title("common sense only", loc="left")
    return figure


def _means(scores: Sequence[TaskScore], tasks: Sequence[str]) -> list[float | None]:
    means = {score.task: score.pass_at(1).mean for score in scores}
    return [means.get(task) for task in tasks]


# --- curves


def thresholds(runs: Sequence[JudgedRun]) -> Figure:
    """Draw the share of prompts by threshold of pass@1, one line per model."""
    most = most_completions(runs)
    lines = {run.name: _steps(threshold_curve([*run.by_prompt.values()]), most) for run in runs}
    means = [run.mean for run in runs]
    figure = _plot_lines(lines, means, 2.75, drawstyle="steps-post", markevery=[0, -1])
    _threshold_axes(figure.axes[0], most)
    _threshold_labels(figure.axes[0], most)
    return figure


def most_completions(runs: Sequence[JudgedRun]) -> int:
    """The most completions of any prompt; at least 2, since an axis needs two ends."""
    return max(2, *(prompt.n for run in runs for score in run.scores for prompt in score.prompts))


def accepted(shares: Mapping[str, Sequence[float]]) -> Figure:
    """Draw the share of accepted programs by number of retries, one line per model."""
    lines = {name: [*enumerate(those)] for name, those in shares.items()}
    figure = _plot_lines(lines, [those[-1] for those in shares.values()], 2.6, markevery=[*LIMITS])
    axes = figure.axes[0]
    axes.set_xscale("symlog", linthresh=1)
    axes.set_xlim(0, LIMITS[-1])
    axes.set_xticks([*LIMITS], [str(limit) for limit in LIMITS])
    axes.minorticks_off()
    share_axis(axes)
    axes.set_xlabel("retries (at most)")
    axes.set_ylabel("accepted programs")
    return figure


def _plot_lines(
    lines: Mapping[str, Points],
    quality: Sequence[float],
    height: float,
    **style: Any,  # noqa: ANN401 - options of matplotlib
) -> Figure:
    """Draw a line for each model; only the best have colours if there are too many models."""
    is_narrow = len(lines) <= MOST_COLOURS
    columns = 1 if is_narrow and max(len(short_name(name)) for name in lines) > SHORT_NAME else 2
    figure = new_figure(NARROW if is_narrow else WIDE, height + 0.13 * math.ceil(len(lines) / columns))
    axes = figure.add_subplot()
    best = sorted(range(len(lines)), key=lambda number: -quality[number])[:MOST_COLOURS]
    for number, (name, points) in enumerate(lines.items()):
        if number not in best:
            axes.plot(*zip(*points, strict=True), color=FAINT, linewidth=0.7, zorder=1, **style)
            continue
        at = number if is_narrow else best.index(number)
        dashes = {"linestyle": DASHES[at % len(DASHES)], "marker": MARKERS[at % len(MARKERS)], **style}
        look = {
            "color": COLOURS[at],
            "label": short_name(name),
            "markersize": 3.2,
            "clip_on": False,
            **dashes,
        }
        axes.plot(*zip(*points, strict=True), **look)
    if not is_narrow:
        axes.plot([], [], color=FAINT, linewidth=0.7, label=f"{len(lines) - MOST_COLOURS} others")
    figure.legend(loc="outside lower center", ncols=columns, handlelength=3.2)
    return figure


def _steps(points: Points, most: int) -> Points:
    """The part of a curve down to a threshold of 1 / `most`, the end of the axis."""
    end = 1 / most
    shown = [(threshold, share) for threshold, share in points if threshold >= end]
    return [*shown, (end, shown[-1][1])]


def _threshold_axes(axes: Axes, most: int) -> None:
    """Set the scale and labels of shared axes; setting one of them sets all."""
    axes.set_xscale("log")
    axes.set_xlim(1, 1 / most)
    shown = (*(BETWEEN if most <= SHORT_AXIS else ()), *POWERS)
    marked = [mark for mark in shown if mark * most >= APART]
    axes.set_xticks([1, *marked, 1 / most], ["1", *(f"{power:g}" for power in marked), f"1/{most}"])
    share_axis(axes)


def _threshold_labels(axes: Axes, most: int) -> None:
    axes.minorticks_off()  # drawing them as one line is much faster
    marks = (digit * power for power in POWERS for digit in range(2, 10))
    between = [mark for mark in marks if mark > 1 / most]
    small: dict[str, Any] = {"marker": TICKDOWN, "markersize": 1.5, "markeredgewidth": 0.6}
    axes.plot(between, [0] * len(between), color=INK, clip_on=False, linestyle="none", **small)
    axes.grid(visible=True, axis="y")
    axes.set_xlabel("threshold of pass@1")
    axes.set_ylabel("prompts at or above it")


def limits(curves: Mapping[str, Mapping[int, Points]], most: int) -> Figure:
    """Draw the share of prompts by threshold of pass@1, for each model and limit of retries."""
    columns = {1: 1, 2: 2, 4: 2}.get(len(curves), 3 if len(curves) <= MOST_COLOURS else 5)
    rows = math.ceil(len(curves) / columns)
    figure = new_figure(WIDE if columns > 1 else NARROW, 1.75 * rows + 0.55)
    all_axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    _threshold_axes(all_axes[0, 0], most)
    for axes in all_axes.flat[len(curves) :]:
        axes.set_visible(False)
    for axes, (name, of_limits) in zip(all_axes.flat, curves.items(), strict=False):
        for at, (limit, points) in enumerate(of_limits.items()):
            axes.plot(
                *zip(*_steps(points, most), strict=True),
                color=COLOURS[at - 1] if at else INK,
                linestyle=DASHES[at % len(DASHES)],
                linewidth=1.3,
                label=f"{limit} retries" if limit else "no retry",
                drawstyle="steps-post",
                clip_on=False,
            )
        _threshold_labels(axes, most)
        axes.set_title(short_name(name), loc="left")
        axes.label_outer()
    handles, labels = all_axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5 if columns > 1 else 2, handlelength=3)
    return figure


# --- tables of shares


def heat(axes: Axes, cells: Cells, rows: Sequence[str], columns: Sequence[str]) -> None:
    """Draw a table of shares as a heat map, with numbers if they fit."""
    shown = np.ma.masked_invalid(np.array(cells, dtype=float))
    axes.pcolormesh(shown, cmap=shades(), vmin=0, vmax=1, edgecolors=PAPER, linewidth=0.6)
    axes.invert_yaxis()
    middles = [at + 0.5 for at in range(max(len(rows), len(columns)))]
    axes.set_xticks(middles[: len(columns)], columns, rotation=38, ha="right", rotation_mode="anchor")
    axes.set_yticks(middles[: len(rows)], rows)
    axes.tick_params(left=False, bottom=False, length=0)
    axes.spines[:].set_color(FAINT)
    axes.spines[:].set_visible(True)
    if len(columns) > MOST_NUMBERS:
        return
    for y, shares in zip(middles, cells, strict=False):
        for x, share in zip(middles, shares, strict=False):
            if share is not None:
                colour = QUIET if share == 0 else INK if share < DARK_FROM else WHITE
                cell = axes.text(x, y, _percent(share), ha="center", va="center", color=colour, fontsize=6)
                cell.set_in_layout(False)  # text inside the axes only slows the layout down


def _percent(share: float) -> str:
    return f"{100 * share:.0f}" if share == 0 or share >= 0.01 else "<1"  # noqa: PLR2004 - one percent


def causes(found: Sequence[tuple[str, Causes]]) -> Figure:
    """Draw the outcomes of completions by class, and the kinds of each class."""
    happened = {name for _, one in found for name, share in one.classes.items() if share}
    shown = classes_to_show(happened)
    kinds = {name: kinds_in_order([one for _, one in found], name) for name in shown}
    tallest = max(3, *map(len, kinds.values()))
    many = len(found) > MOST_NUMBERS
    longest = 0 if many else max(len(short_name(name, 18)) for name, _ in found)
    # Slanted names of models need room below the panels.
    below = 0.95 + (0.13 * len(found) if many else 0.155 * tallest) + 0.04 * max(0, longest - 8)
    columns = len(shown) if many or len(shown) <= MOST_PANELS else 2
    lines = math.ceil(len(shown) / columns)
    heights = [1.05 + 0.2 * len(found), below * lines]
    figure = new_figure(WIDE, sum(heights))
    upper, lower = figure.subfigures(2, 1, height_ratios=heights, squeeze=False)[:, 0]
    axes = upper.add_subplot()
    _classes(axes, found, shown)
    legend = {"ncols": max(4, 1 + len(shown)), "handlelength": 1.4}
    upper.legend(*axes.get_legend_handles_labels(), loc="outside lower center", **legend)
    panels = lower.subplots(lines, columns, squeeze=False, sharey=many).flat
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    for axes, letter, name in zip(panels, "bcdefgh", shown, strict=False):
        axes.set_title(f"({letter}) {plural_of(name)}", loc="left")
        _kinds(axes, found, name, kinds[name], many=many)
    return figure


def _classes(axes: Axes, found: Sequence[tuple[str, Causes]], shown: Sequence[str]) -> None:
    axes.set_title("(a) outcomes of completions", loc="left")
    left = np.zeros(len(found))
    places = range(len(found))
    looks = _looks()
    for name in (PASSED, *shown):
        colour, hatch = looks[name]
        shares = np.array([one.classes.get(name, 0.0) for _, one in found])
        style: dict[str, Any] = {"color": colour, "hatch": hatch, "edgecolor": PAPER, "linewidth": 0.4}
        label = name if name == PASSED else plural_of(name)
        axes.barh(places, shares, 0.72, left=left, label=label, **style)
        left = left + shares
    axes.set_yticks(places, [short_name(name, 34) for name, _ in found])
    axes.set_ylim(len(found) - 0.5, -0.5)
    axes.tick_params(axis="y", left=False, length=0)
    share_axis(axes, along="x")


def _looks() -> dict[str, tuple[str, str]]:
    """The colour and the hatch of each outcome; the paper's classes always have the same ones."""
    others = [name for name in FAILURE_CLASSES if name != NO_PROGRAM_CLASS]
    colours = cycle(COLOURS[at] for at in (1, 0, 3, 2, 4, 5))
    hatches = cycle(("", "////", "\\\\\\\\", "....", ""))
    of_others = {one: look for one, *look in zip(others, colours, hatches, strict=False)}
    looks = {name: (colour, hatch) for name, (colour, hatch) in of_others.items()}
    return {PASSED: (FAINT, ""), NO_PROGRAM_CLASS: (QUIET, ""), **looks}


def _with_count(name: str, count: int | None) -> str:
    return name if count is None else f"{name} (n = {count:,})"


def _kinds(
    axes: Axes, found: Sequence[tuple[str, Causes]], of: str, kinds: Sequence[str], *, many: bool
) -> None:
    there = [
        (_with_count(short_name(name, 18), one.counts.get((of, ALL))), one.kinds.get(of, {}))
        for name, one in found
        if many or one.kinds.get(of)
    ]
    if not kinds:
        axes.text(0.5, 0.5, "none", ha="center", va="center", transform=axes.transAxes)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    cells = [[shares.get(kind, 0.0) if shares else None for kind in kinds] for _, shares in there]
    names, labels = [name for name, _ in there], [short_name(kind, 24) for kind in kinds]
    if many:
        heat(axes, cells, names, labels)
    else:
        heat(axes, [*zip(*cells, strict=True)], labels, names)
