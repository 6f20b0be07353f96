"""Tables of shares drawn with shades, and the figure of causes of failures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from roboeval.evaluation.failures import CLASSES, PYTHON, ROBOT, TASK
from roboeval.report.causes import PASSED, Causes, kinds_in_order
from roboeval.report.drawing import WIDE, Look, brief, new_figure, share_axis

FULL = "#00507d"  # the shade of a share of 1; one hue is read by every eye, and in print
MOST_NUMBERS = 14  # rows or columns up to which each cell says its number
DARK_FROM = 0.75  # the share from which white is read better than black
PANELS = (
    (PYTHON, "(b) Python errors"),
    (ROBOT, "(c) robot errors"),
    (TASK, "(d) failed checks"),
)
WORDS = {
    PASSED: "passed",
    PYTHON: "Python error",
    ROBOT: "robot execution error",
    TASK: "task completion error",
}


@dataclass(frozen=True)
class Heat:
    """A table of shares.

    Args:
        cells: by row; None where there is none.
        rows: their names.
        columns: their names.
    """

    cells: Sequence[Sequence[float | None]]
    rows: Sequence[str]
    columns: Sequence[str]


def draw_heat(axes: Axes, heat: Heat, look: Look) -> None:
    """Draw a table of shares: the more, the more colour; with numbers where there is room for them."""
    cells = np.array([[np.nan if cell is None else cell for cell in row] for row in heat.cells], dtype=float)
    shades = LinearSegmentedColormap.from_list("shades", [look.paper, look.middle, FULL])
    shown = np.ma.masked_invalid(cells)
    axes.pcolormesh(shown, cmap=shades, vmin=0, vmax=1, edgecolors=look.paper, linewidth=0.6)
    axes.invert_yaxis()
    axes.set_xticks(_middles(heat.columns), heat.columns, rotation=38, ha="right", rotation_mode="anchor")
    axes.set_yticks(_middles(heat.rows), heat.rows)
    axes.tick_params(length=0)
    axes.spines[:].set_color(look.faint)
    axes.spines[:].set_visible(True)
    if len(heat.columns) > MOST_NUMBERS:
        return
    for row, shares in enumerate(heat.cells):
        for column, share in enumerate(shares):
            if share is not None:
                colour = look.quiet if share == 0 else look.ink if share < DARK_FROM else "white"
                axes.text(
                    column + 0.5,
                    row + 0.5,
                    _percent(share),
                    ha="center",
                    va="center",
                    color=colour,
                    fontsize=6,
                )


def _middles(names: Sequence[str]) -> list[float]:
    return [at + 0.5 for at in range(len(names))]


def _percent(share: float) -> str:
    return f"{100 * share:.0f}" if share == 0 or share >= 0.01 else "<1"  # noqa: PLR2004 - one in a hundred


def causes_figure(causes: Sequence[Causes], look: Look) -> Figure:
    """How completions end, by class, and by the kinds of each class."""
    kinds = [kinds_in_order(causes, name) for name, _ in PANELS]
    tallest = max(3, *map(len, kinds))
    many = len(causes) > MOST_NUMBERS
    longest = 0 if many else max(len(brief(one.name, 18)) for one in causes)
    heights = _heights(len(causes), tallest, many=many)
    heights[1] += 0.04 * max(0, longest - 8)  # names of models stand aslant below the panels
    figure = new_figure(WIDE, sum(heights))
    above, below = figure.subfigures(2, 1, height_ratios=heights, squeeze=False)[:, 0]
    axes = above.add_subplot()
    _classes(axes, causes, look)
    handles, labels = axes.get_legend_handles_labels()
    above.legend(handles, labels, loc="outside lower center", ncols=4, handlelength=1.4)
    panels = below.subplots(1, 3, squeeze=False, sharey=many)[0]
    for axes, (name, title), those in zip(panels, PANELS, kinds, strict=True):
        axes.set_title(title, loc="left")
        _kinds(axes, causes, name, those, look, many=many)
    return figure


def _heights(models: int, tallest: int, *, many: bool) -> list[float]:
    return [1.05 + 0.2 * models, 0.95 + (0.13 * models if many else 0.155 * tallest)]


def _classes(axes: Axes, causes: Sequence[Causes], look: Look) -> None:
    axes.set_title("(a) how completions end", loc="left")
    left = [0.0] * len(causes)
    places = range(len(causes))
    colours = (look.faint, *(look.colour(i) for i in (1, 0, 3)))
    hatches = ("", "", "////", "\\\\\\\\")
    for name, colour, hatch in zip((PASSED, *CLASSES), colours, hatches, strict=True):
        shares = [one.classes.get(name, 0.0) for one in causes]
        axes.barh(
            places,
            shares,
            0.72,
            left=left,
            color=colour,
            hatch=hatch,
            edgecolor=look.paper,
            linewidth=0.4,
            label=WORDS[name],
        )
        left = [a + b for a, b in zip(left, shares, strict=True)]
    axes.set_yticks(places, [brief(one.name, 34) for one in causes])
    axes.set_ylim(len(causes) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    share_axis(axes, along="x")


def _kinds(
    axes: Axes, causes: Sequence[Causes], name: str, kinds: Sequence[str], look: Look, *, many: bool
) -> None:
    there = [one for one in causes if many or one.kinds.get(name)]
    if not kinds:
        axes.text(0.5, 0.5, "none", ha="center", va="center", transform=axes.transAxes)
        axes.set_xticks([])
        axes.set_yticks([])
        return
    names = [brief(one.name, 18) for one in there]
    cells: list[list[float | None]] = [
        [one.kinds[name].get(kind, 0.0) if one.kinds.get(name) else None for one in there] for kind in kinds
    ]
    labels = [brief(kind, 24) for kind in kinds]
    if many:
        draw_heat(axes, Heat([*zip(*cells, strict=True)], names, labels), look)
    else:
        draw_heat(axes, Heat(cells, labels, names), look)
