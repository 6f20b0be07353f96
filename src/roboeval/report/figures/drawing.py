"""Defines the style of all figures, and renders them reproducibly as PNG, PDF and SVG."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from codebotler.core.terminal import visible

PAGE_WIDTH, COLUMN_WIDTH = 7.16, 3.5  # widths of a page and of a column of a paper, in inches
DPI, POINTS = 300, 72  # pixels and points per inch

BACKGROUND, FOREGROUND, PALE, MUTED = "#ffffff", "#1b1b1f", "#d5d5da", "#6f6f78"
DARKEST_SHADE = "#00507d"  # for a share of 1; a single hue suits colour-blind readers and print
MIDDLE_SHADE = "#7fb5d5"
# The palette by Okabe and Ito, whose colours can be told apart by colour-blind readers.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#000000", "#F0E442")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
MAX_FIGURE_NAME = 26
MAX_LEGEND_NAME = 16  # characters; two of these names fit side by side below a narrow figure

FIGURE_STYLE: dict[Any, Any] = {
    **mpl.rc_params_from_file(Path(__file__).with_name("figures.mplstyle"), use_default_template=False),
    **dict.fromkeys(
        ("axes.edgecolor", "axes.labelcolor", "text.color", "xtick.color", "ytick.color"), FOREGROUND
    ),
    **dict.fromkeys(("axes.facecolor", "figure.facecolor", "savefig.facecolor"), BACKGROUND),
    "grid.color": PALE,
}


@contextmanager
def use_style() -> Iterator[None]:
    """In the `with` block, draw in the style of reports instead of the user's matplotlib settings."""
    with warnings.catch_warnings(), mpl.rc_context():
        warnings.simplefilter("ignore")  # names may contain characters that the font lacks
        mpl.rcdefaults()
        mpl.rcParams.update(FIGURE_STYLE)
        yield


def new_figure(width: float, height: float) -> Figure:
    """Create an empty figure with automatic layout. `width` and `height` are in inches."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def render(figure: Figure) -> dict[str, bytes]:
    """Return a figure as bytes by file ending (`png`, `pdf`, `svg`). Equal figures give equal bytes."""
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)
        figure.set_layout_engine(None)
    files = {kind: io.BytesIO() for kind in ("png", "pdf", "svg")}
    figure.savefig(files["png"], format="png", metadata={"Software": None}, pil_kwargs={"compress_level": 3})
    no_metadata = dict.fromkeys(("Creator", "Producer", "CreationDate"))
    figure.savefig(files["pdf"], format="pdf", metadata=no_metadata)
    figure.savefig(files["svg"], format="svg", metadata=dict.fromkeys(("Creator", "Date")))
    return {kind: file.getvalue() for kind, file in files.items()}


def shades() -> LinearSegmentedColormap:
    """Return the colour map for shares, from white for 0 to dark blue for 1."""
    return LinearSegmentedColormap.from_list("shades", [BACKGROUND, MIDDLE_SHADE, DARKEST_SHADE])


def short_name(name: str, most: int = MAX_FIGURE_NAME) -> str:
    """Shorten a name to `most` characters by omitting its middle, because names differ most at the ends."""
    name, end = visible(name), (most - 1) // 2
    return name if len(name) <= most else f"{name[: most - 1 - end]}…{name[-end:]}"


def share_axis(axes: Axes, *, along: str = "y") -> None:
    """Scale an axis for shares, from 0 to 100%. `along` is `x` or `y`."""
    axis = axes.yaxis if along == "y" else axes.xaxis
    (axes.set_ylim if along == "y" else axes.set_xlim)(0, 1)
    axis.set_ticks([0, 0.25, 0.5, 0.75, 1], ["0", "25", "50", "75", "100%"])
    axes.grid(visible=True, axis="y" if along == "y" else "x")
