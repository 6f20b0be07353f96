"""The figures of section V of the paper: bars by task, curves over prompts, curves of rejection sampling."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter

from roboeval.analysis.metrics import TaskScore
from roboeval.analysis.resample import LIMITS
from roboeval.report import retries
from roboeval.report.drawing import (
    DASHES,
    MARKERS,
    MOST_COLOURS,
    NARROW,
    WIDE,
    Look,
    brief,
    new_figure,
    share_axis,
)
from roboeval.report.heat import Heat, draw_heat
from roboeval.report.reading import JudgedRun
from roboeval.report.scores import curve, tasks_of
from roboeval.suites.load import Suite

LOWEST = 1e-3  # where the paper ends its axis
A_ROW = 8  # tasks that stand beside each other
FEWEST = 4  # tasks for which there is room, lest a single bar fill a page
SHORT_NAME = 16  # letters up to which two names stand beside each other below a narrow figure
BAR = 0.82  # of the room that a task has


# --- pass@1 by task


def bars(runs: Sequence[JudgedRun], suite: Suite, look: Look) -> Figure:
    """pass@1 by task and model, with the range over prompts, and the ablated tasks beside it."""
    if len(runs) > MOST_COLOURS:
        return _heat_of_tasks(runs, suite, look)
    tasks, ablated = tasks_of(runs, suite), _ablated_tasks(runs, suite)
    lines = max(1, math.ceil(len(tasks) / A_ROW))
    widest = math.ceil(len(tasks) / lines)
    figure = new_figure(WIDE, 1.75 * lines + 0.45)
    widths = [widest, max(2, len(ablated) / lines)] if ablated else [widest]
    grid = figure.add_gridspec(lines, len(widths), width_ratios=widths)
    for line in range(lines):
        axes = figure.add_subplot(grid[line, 0])
        here = tasks[line * widest : (line + 1) * widest]
        _bars_on(axes, {run.name: run.scores for run in runs}, here, max(widest, FEWEST), look)
        axes.set_ylabel("pass@1")
        if line == 0 and ablated:
            axes.set_title("(a) all requirements", loc="left")
    for line, there in enumerate(_in_lines(ablated, lines)):
        axes = figure.add_subplot(grid[line, 1])
        scores = {run.name: run.ablated_scores for run in runs}
        _bars_on(axes, scores, there, max(map(len, _in_lines(ablated, lines))), look)
        if line == 0:
            axes.set_title("(b) common sense only", loc="left")
    handles = [Patch(color=look.colour(i), label=brief(run.name)) for i, run in enumerate(runs)]
    columns = 5 if max(len(brief(run.name)) for run in runs) <= SHORT_NAME else 3
    figure.legend(
        handles=handles, loc="outside lower center", ncols=min(len(runs), columns), handlelength=1.0
    )
    return figure


def _in_lines(tasks: Sequence[str], lines: int) -> list[Sequence[str]]:
    if not tasks:
        return []
    each = math.ceil(len(tasks) / lines)
    return [tasks[start : start + each] for start in range(0, len(tasks), each)]


def _ablated_tasks(runs: Sequence[JudgedRun], suite: Suite) -> list[str]:
    there = {score.task for run in runs for score in run.ablated_scores}
    return [task for task in suite.tasks if task in there]


def _bars_on(
    axes: Axes, scores: Mapping[str, Sequence[TaskScore]], tasks: Sequence[str], room: int, look: Look
) -> None:
    width = BAR / len(scores)
    for number, those in enumerate(scores.values()):
        by_task = {score.task: score for score in those}
        there = [(at, by_task[task]) for at, task in enumerate(tasks) if task in by_task]
        places = [at + (number + 0.5) * width - BAR / 2 for at, _ in there]
        means = [score.pass_at(1).mean for _, score in there]
        below = [max(0.0, mean - score.lowest(1)) for mean, (_, score) in zip(means, there, strict=True)]
        above = [max(0.0, score.highest(1) - mean) for mean, (_, score) in zip(means, there, strict=True)]
        axes.bar(
            places,
            means,
            width * 0.92,
            color=look.colour(number),
            yerr=[below, above],
            error_kw={
                "elinewidth": 0.7,
                "capsize": min(2.5, 14 * width),
                "capthick": 0.7,
                "ecolor": look.ink,
            },
        )
        zeros = [place for place, mean in zip(places, means, strict=True) if mean == 0]
        if zeros:
            axes.plot(zeros, [0] * len(zeros), "o", color=look.colour(number), markersize=2.2, clip_on=False)
    beside = (room - len(tasks)) / 2 if len(tasks) < FEWEST else 0
    axes.set_xlim(-0.5 - beside, room - 0.5 - beside)
    axes.set_ylim(0, 1.03)
    axes.set_yticks([0, 0.5, 1])
    axes.grid(visible=True, axis="y")
    axes.set_xticks(range(len(tasks)), [_two_lines(task) for task in tasks])
    axes.tick_params(axis="x", length=0, labelsize=6.5 if room > 6 else 7)  # noqa: PLR2004 - many labels


def _two_lines(task: str) -> str:
    """The name of a task, broken before a capital letter in the middle."""
    capitals = [at for at, letter in enumerate(task) if at and letter.isupper()]
    return (
        f"{brief(task[: capitals[-1]], 14)}\n{brief(task[capitals[-1] :], 14)}"
        if capitals
        else brief(task, 14)
    )


def _heat_of_tasks(runs: Sequence[JudgedRun], suite: Suite, look: Look) -> Figure:
    """The same for more models than there are colours: one row a model."""
    tasks, ablated = tasks_of(runs, suite), _ablated_tasks(runs, suite)
    plain = [_means(run.scores, tasks) for run in runs]
    alone = [_means(run.ablated_scores, ablated) for run in runs]
    figure = new_figure(WIDE, 1.3 + 0.16 * len(runs))
    widths = [len(tasks), len(ablated)] if ablated else [len(tasks)]
    grid = figure.add_gridspec(1, len(widths), width_ratios=widths)
    names = [brief(run.name) for run in runs]
    draw_heat(figure.add_subplot(grid[0, 0]), Heat(plain, names, tasks), look)
    if ablated:
        axes = figure.add_subplot(grid[0, 1])
        draw_heat(axes, Heat(alone, [""] * len(runs), ablated), look)
        axes.set_title("common sense only", loc="left")
    return figure


def _means(scores: Sequence[TaskScore], tasks: Sequence[str]) -> list[float | None]:
    means = {score.task: score.pass_at(1).mean for score in scores}
    return [means.get(task) for task in tasks]


# --- curves


def thresholds(runs: Sequence[JudgedRun], look: Look) -> Figure:
    """The share of prompts by threshold of pass@1, one line a model, on the paper's axis."""
    columns = _legend_columns([run.name for run in runs])
    width = NARROW if len(runs) <= MOST_COLOURS else WIDE
    figure = new_figure(width, 2.75 + 0.13 * math.ceil(len(runs) / columns))
    axes = figure.add_subplot()
    best = sorted(range(len(runs)), key=lambda i: -_mean_of(runs[i]))[:MOST_COLOURS]
    for number, run in enumerate(runs):
        points = curve([*run.by_prompt.values()])
        if number in best:
            _line(
                axes,
                points,
                best.index(number) if len(runs) > MOST_COLOURS else number,
                brief(run.name),
                look,
            )
        else:
            _steps(axes, points, color=look.faint, linewidth=0.7, zorder=1)
    if len(runs) > MOST_COLOURS:
        axes.plot([], [], color=look.faint, linewidth=0.7, label=f"{len(runs) - MOST_COLOURS} others")
    _threshold_axes(axes)
    _threshold_labels(axes)
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=columns, handlelength=3.2
    )
    return figure


def _legend_columns(names: Sequence[str]) -> int:
    """In how many columns a legend fits below a narrow figure."""
    is_narrow = len(names) <= MOST_COLOURS
    return 1 if is_narrow and max(len(brief(name)) for name in names) > SHORT_NAME else 2


def _mean_of(run: JudgedRun) -> float:
    values = [*run.by_prompt.values()]
    return sum(values) / len(values)


def _line(axes: Axes, points: Sequence[tuple[float, float]], number: int, label: str, look: Look) -> None:
    _steps(
        axes,
        points,
        is_marked=True,
        color=look.colour(number),
        linestyle=DASHES[number % len(DASHES)],
        marker=MARKERS[number % len(MARKERS)],
        markersize=3.2,
        label=label,
    )


def _steps(
    axes: Axes,
    points: Sequence[tuple[float, float]],
    *,
    is_marked: bool = False,
    **style: Any,  # noqa: ANN401 - matplotlib's own
) -> None:
    shown = [(threshold, share) for threshold, share in points if threshold >= LOWEST]
    xs, ys = zip(*shown, (LOWEST, shown[-1][1]), strict=True)
    ends = [0, len(shown)] if is_marked else None
    axes.plot(xs, ys, drawstyle="steps-post", clip_on=False, markevery=ends, **style)


def _threshold_axes(axes: Axes) -> None:
    """Set what axes that share theirs share; to be set once, since each time all of them are set."""
    axes.set_xscale("log")
    axes.set_xlim(1, LOWEST)
    axes.set_xticks([1, 0.1, 0.01, LOWEST], ["1", "0.1", "0.01", "0.001"])
    axes.xaxis.set_minor_formatter(NullFormatter())
    share_axis(axes)


def _threshold_labels(axes: Axes) -> None:
    axes.tick_params(axis="x", which="minor", length=1.5)
    axes.grid(visible=True, axis="y")
    axes.set_xlabel("threshold of pass@1")
    axes.set_ylabel("prompts that reach it")


# --- rejection sampling


def limits(runs: Sequence[JudgedRun], look: Look) -> Figure | None:
    """For each model and limit of retries, the share of prompts by threshold; None if none was checked."""
    found = retries.checked(runs)
    if not found:
        return None
    columns = {1: 1, 2: 2, 4: 2}.get(len(found), 3 if len(found) <= MOST_COLOURS else 5)
    rows = math.ceil(len(found) / columns)
    figure = new_figure(WIDE if columns > 1 else NARROW, 1.75 * rows + 0.55)
    all_axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    _threshold_axes(all_axes[0, 0])
    for number, axes in enumerate(all_axes.flat):
        if number >= len(found):
            axes.set_visible(False)
            continue
        name, prompts = found[number]
        for at, (limit, points) in enumerate(retries.curves(prompts).items()):
            label = "no retry" if limit == 0 else f"{limit} retries"
            _steps(
                axes,
                points,
                color=look.ink if limit == 0 else look.colour(at - 1),
                linestyle=DASHES[at % len(DASHES)],
                linewidth=1.0 if limit == 0 else 1.3,
                label=label if number == 0 else None,
            )
        _threshold_labels(axes)
        axes.set_title(brief(name), loc="left")
        axes.label_outer()
    handles, labels = all_axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5 if columns > 1 else 2, handlelength=3)
    return figure


def at_the_limit(runs: Sequence[JudgedRun], look: Look) -> Figure | None:
    """The share of programs that the check accepts by number of retries; None if none was checked."""
    found = retries.checked(runs)
    if not found:
        return None
    columns = _legend_columns([name for name, _ in found])
    width = NARROW if len(found) <= MOST_COLOURS else WIDE
    figure = new_figure(width, 2.6 + 0.13 * math.ceil(len(found) / columns))
    axes = figure.add_subplot()
    shares = [(name, retries.accepted(prompts)) for name, prompts in found]
    best = sorted(range(len(shares)), key=lambda i: (-shares[i][1][-1], i))[:MOST_COLOURS]
    for number, (name, share) in enumerate(shares):
        if number in best:
            colour = number if len(shares) <= MOST_COLOURS else best.index(number)
            axes.plot(
                retries.STEPS,
                share,
                color=look.colour(colour),
                linestyle=DASHES[colour % len(DASHES)],
                marker=MARKERS[colour % len(MARKERS)],
                markersize=3.2,
                markevery=[*LIMITS],
                label=brief(name),
                clip_on=False,
            )
        else:
            axes.plot(retries.STEPS, share, color=look.faint, linewidth=0.7, zorder=1)
    if len(shares) > MOST_COLOURS:
        axes.plot([], [], color=look.faint, linewidth=0.7, label=f"{len(shares) - MOST_COLOURS} others")
    axes.set_xscale("symlog", linthresh=1)
    axes.set_xlim(0, LIMITS[-1])
    axes.set_xticks([*LIMITS], [str(limit) for limit in LIMITS])
    axes.minorticks_off()
    share_axis(axes)
    axes.set_xlabel("retries at most")
    axes.set_ylabel("programs that are accepted")
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=columns, handlelength=3.2
    )
    return figure
