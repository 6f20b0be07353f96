"""Draws curves: the share of prompts that reach each pass@1, and the effect of retries."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from roboeval.analysis.metrics import threshold_curve
from roboeval.analysis.resample import LIMITS
from roboeval.report.figures.drawing import (
    COLOURS,
    COLUMN_WIDTH,
    DASHES,
    FOREGROUND,
    MARKERS,
    MAX_LEGEND_NAME,
    PAGE_WIDTH,
    new_figure,
    share_axis,
    short_name,
)
from roboeval.report.runs import JudgedRun

LABELLED_THRESHOLDS = (0.5, 0.2, 0.1, 0.01, 0.001)  # tick labels of the threshold axis
MIN_LABEL_RATIO = 1.6  # two labels with a smaller ratio would overlap

Points: TypeAlias = Sequence[tuple[float, float]]


def draw_thresholds(runs: Sequence[JudgedRun]) -> Figure:
    """Draw the share of prompts that reach each threshold of pass@1, with one line per run."""
    most = most_completions(runs)
    lines = {run.name: _steps(threshold_curve([*run.by_prompt.values()]), most) for run in runs}
    figure = _plot_lines(lines, 2.75, drawstyle="steps-post", markevery=[0, -1])
    _threshold_axes(figure.axes[0], most)
    _threshold_labels(figure.axes[0])
    return figure


def most_completions(runs: Sequence[JudgedRun]) -> int:
    """Return the largest number of completions of any prompt, at least 2, so that the axis has a length."""
    return max(2, *(prompt.completions for run in runs for score in run.scores for prompt in score.prompts))


def draw_accepted(shares: Mapping[str, Sequence[float]]) -> Figure:
    """Draw the share of accepted programs after 0, 1, 2, ... retries, with one line per run."""
    lines = {name: [*enumerate(those)] for name, those in shares.items()}
    figure = _plot_lines(lines, 2.6, markevery=[*LIMITS])
    axes = figure.axes[0]
    axes.set_xscale("symlog", linthresh=1)
    axes.set_xlim(0, LIMITS[-1])
    axes.set_xticks([*LIMITS], [str(limit) for limit in LIMITS])
    axes.minorticks_off()
    share_axis(axes)
    axes.set_xlabel("retries (at most)")
    axes.set_ylabel("accepted programs")
    return figure


def _plot_lines(lines: Mapping[str, Points], height: float, **style: Any) -> Figure:  # noqa: ANN401 - for matplotlib
    """Draw one line per model."""
    columns = 1 if max(len(short_name(name)) for name in lines) > MAX_LEGEND_NAME else 2
    figure = new_figure(COLUMN_WIDTH, height + 0.13 * math.ceil(len(lines) / columns))
    axes = figure.add_subplot()
    for at, (name, points) in enumerate(lines.items()):
        look = {"linestyle": DASHES[at % len(DASHES)], "marker": MARKERS[at % len(MARKERS)], **style}
        look |= {"color": COLOURS[at], "label": short_name(name), "markersize": 3.2, "clip_on": False}
        axes.plot(*zip(*points, strict=True), **look)
    figure.legend(loc="outside lower center", ncols=columns, handlelength=3.2)
    return figure


def _steps(points: Points, most: int) -> Points:
    """Cut a curve at the threshold 1 / `most`, where the axis ends."""
    lowest = 1 / most
    shown = [(threshold, share) for threshold, share in points if threshold >= lowest]
    return [*shown, (lowest, shown[-1][1])]


def _threshold_axes(axes: Axes, most: int) -> None:
    """Set the scale and labels of a threshold axis. Axes that share it follow."""
    axes.set_xscale("log")
    axes.set_xlim(1, 1 / most)
    marked = [mark for mark in LABELLED_THRESHOLDS if mark * most >= MIN_LABEL_RATIO]
    axes.set_xticks([1, *marked, 1 / most], ["1", *(f"{power:g}" for power in marked), f"1/{most}"])
    share_axis(axes)


def _threshold_labels(axes: Axes) -> None:
    axes.minorticks_off()  # drawing is much faster without minor ticks
    axes.grid(visible=True, axis="y")
    axes.set_xlabel("threshold of pass@1")
    axes.set_ylabel("prompts at or above it")


def draw_limits(curves: Mapping[str, Mapping[int, Points]], most: int) -> Figure:
    """Draw the share of prompts that reach each pass@1 from 1 to 1 / `most`, by run and limit on retries."""
    columns = {1: 1, 2: 2, 4: 2}.get(len(curves), 3)
    rows = math.ceil(len(curves) / columns)
    figure = new_figure(PAGE_WIDTH if columns > 1 else COLUMN_WIDTH, 1.75 * rows + 0.55)
    all_axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    _threshold_axes(all_axes[0, 0], most)
    for axes in all_axes.flat[len(curves) :]:
        axes.set_visible(False)
    for axes, (name, of_limits) in zip(all_axes.flat, curves.items(), strict=False):
        for at, (limit, points) in enumerate(of_limits.items()):
            axes.plot(
                *zip(*_steps(points, most), strict=True),
                color=COLOURS[at - 1] if at else FOREGROUND,
                linestyle=DASHES[at % len(DASHES)],
                linewidth=1.3,
                label=f"{limit} retries" if limit else "no retry",
                drawstyle="steps-post",
                clip_on=False,
            )
        _threshold_labels(axes)
        axes.set_title(short_name(name), loc="left")
        axes.label_outer()
    handles, labels = all_axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5 if columns > 1 else 2, handlelength=3)
    return figure
