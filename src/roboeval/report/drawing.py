"""How all figures look, and how they are written so that the same numbers give the same bytes."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, to_hex
from matplotlib.figure import Figure

from codebotler.terminal import visible

WIDE, NARROW = 7.16, 3.5  # inches: both columns of a paper, and one

PAPER, INK, FAINT, QUIET = "#ffffff", "#1b1b1f", "#d5d5da", "#6f6f78"
BLACK, WHITE = "#010101", "#fefefe"  # of data, and of text on full shades; SVG leaves out what is #000000
FULL = "#00507d"  # the shade of a share of 1; one hue is read by every eye, and in print
MIDDLE = "#7fb5d5"
DARK = {PAPER: "#17181c", INK: "#e6e6ea", FAINT: "#3d3f47", QUIET: "#8f919b", BLACK: "#ffffff"}
"""What takes the place of a colour on a dark page; colours of data stay."""
DARK_MIDDLE = "#2b5f80"

COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", BLACK, "#F0E442")
"""Okabe and Ito's, which people who see colours differently tell apart, too."""

DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.5, 1.2, 1.5)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
LONGEST_NAME = 26

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.titlesize": 8,
    "axes.labelsize": 7.5,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    **dict.fromkeys(("axes.edgecolor", "axes.labelcolor", "text.color", "xtick.color", "ytick.color"), INK),
    **dict.fromkeys(("axes.facecolor", "figure.facecolor", "savefig.facecolor"), PAPER),
    "axes.axisbelow": True,
    "text.parse_math": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": FAINT,
    "grid.linewidth": 0.5,
    "hatch.linewidth": 0.5,
    "lines.linewidth": 1.4,
    "svg.hashsalt": "roboeval",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "pdf.compression": 6,
}


@contextmanager
def styled() -> Iterator[None]:
    """Draw and write figures in one style; no setting of the reader's own plays a part."""
    with warnings.catch_warnings(), mpl.rc_context():
        warnings.simplefilter("ignore")  # a name may hold letters that the font lacks
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of so many inches that places what stands in it by itself."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def written(figure: Figure, kind: str) -> bytes:
    """A figure as png, pdf or svg, with no date and no version in it."""
    nothing: dict[str, dict[str, None]] = {
        "png": {"Software": None},
        "pdf": {"Creator": None, "Producer": None, "CreationDate": None},
        "svg": {"Creator": None, "Date": None},
    }
    if (layout := figure.get_layout_engine()) is not None:  # once, for all formats
        layout.execute(figure)
        figure.set_layout_engine(None)  # "none" would leave one behind, for which all is drawn twice
    content = io.BytesIO()
    figure.savefig(content, format=kind, dpi=300 if kind == "png" else 72, metadata=nothing[kind])
    return _slim(content.getvalue()) if kind == "svg" else content.getvalue()


def _slim(svg: bytes) -> bytes:
    """The same drawing with each letter's shape written once, and not at each of its uses."""
    seen: set[bytes] = set()

    def once(shape: re.Match[bytes]) -> bytes:
        is_new = shape[1] not in seen
        seen.add(shape[1])
        return shape[0] if is_new else b""

    svg = re.sub(rb"<!--.*?-->|<metadata>.*?</metadata>", b"", svg, flags=re.DOTALL)
    svg = re.sub(rb'<path id="(\w+-[0-9a-f]+)"[^>]*?/>', once, svg, flags=re.DOTALL)
    return re.sub(rb"<defs>\s*</defs>|\s*\n\s*", b"\n", svg)


def shades(paper: str = PAPER, middle: str = MIDDLE) -> LinearSegmentedColormap:
    """The shades of shares, from that of 0 to that of 1."""
    return LinearSegmentedColormap.from_list("shades", [paper, middle, FULL])


def darkened(svg: bytes) -> bytes:
    """A drawing in colours for a dark page."""
    light, dark = shades(), shades(DARK[PAPER], DARK_MIDDLE)
    others = {to_hex(light(n)): to_hex(dark(n)) for n in range(light.N)} | DARK
    colours = {old.encode(): new.encode() for old, new in others.items()}
    return re.sub(rb"#[0-9a-f]{6}\b", lambda colour: colours.get(colour[0], colour[0]), svg)


def brief(name: str, most: int = LONGEST_NAME) -> str:
    """A name that fits into a figure: its beginning and its end, by which names are told apart."""
    name, end = visible(name), (most - 1) // 2
    return name if len(name) <= most else f"{name[: most - 1 - end]}…{name[-end:]}"


def share_axis(axes: Axes, *, along: str = "y") -> None:
    """Let an axis show shares from 0 to 100 %."""
    axis = axes.yaxis if along == "y" else axes.xaxis
    (axes.set_ylim if along == "y" else axes.set_xlim)(0, 1)
    axis.set_ticks([0, 0.25, 0.5, 0.75, 1], ["0", "25", "50", "75", "100 %"])
    axes.grid(visible=True, axis="y" if along == "y" else "x")
