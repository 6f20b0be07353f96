"""How all figures look, and how they are written so that the same numbers give the same bytes."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any, ClassVar

import matplotlib as mpl
from fontTools import subset
from matplotlib.axes import Axes
from matplotlib.backend_bases import GraphicsContextBase, RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap, to_hex
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D, Bbox
from PIL import Image

from codebotler.core.terminal import visible

WIDE, NARROW = 7.16, 3.5  # inches: both columns of a paper, and one
DPI, POINTS = 300, 72  # of an inch

PAPER, INK, FAINT, QUIET = "#ffffff", "#1b1b1f", "#d5d5da", "#6f6f78"
BLACK, WHITE = "#010101", "#fefefe"  # of data, and of text on full shades; SVG leaves out what is #000000
FULL = "#00507d"  # the shade of a share of 1; one hue is read by every eye, and in print
MIDDLE = "#7fb5d5"
DARK_MIDDLE = "#2b5f80"
# On a dark page; colours of data stay.
DARK = {PAPER: "#17181c", INK: "#e6e6ea", FAINT: "#3d3f47", QUIET: "#8f919b", BLACK: "#ffffff"}
# Okabe and Ito's, which colour-blind people can tell apart.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", BLACK, "#F0E442")
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
    "text.hinting": "none",  # for so many dots letters need not be moved to them
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


load_font = subset.load_font


def _load_font(*args: Any, **more: Any) -> Any:  # noqa: ANN401 - as fontTools has it
    """A font for a PDF without kerning tables: a PDF places each letter itself, and copying them is slow."""
    font = load_font(*args, **more)
    for table in {"GDEF", "GPOS", "GSUB"}.intersection(font.keys()):
        del font[table]
    return font


subset.load_font = _load_font


@contextmanager
def styled() -> Iterator[None]:
    """Draw and write figures in one style, whatever the reader's own settings."""
    with warnings.catch_warnings(), mpl.rc_context():
        warnings.simplefilter("ignore")  # a name may hold letters that the font lacks
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float) -> Figure:
    """An empty figure that lays itself out; sizes are in inches."""
    return Figure(figsize=(width, height), dpi=DPI, layout="constrained")


def written(figure: Figure) -> dict[str, bytes]:
    """A figure as png, pdf and svg without date and version; laid out and drawn once for all three."""
    canvas = FigureCanvasAgg(figure)
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)
        figure.set_layout_engine(None)
    again = Repetition(figure)
    renderer = canvas.get_renderer()  # type: ignore[no-untyped-call]  # theirs
    figure.draw(Recorder(renderer, again.calls))  # type: ignore[arg-type]  # it has all that one has
    found = {"png": io.BytesIO(), "pdf": io.BytesIO(), "svg": io.BytesIO()}
    picture = Image.frombuffer("RGBA", canvas.get_width_height(), renderer.buffer_rgba()).convert("RGB")
    picture.save(found["png"], format="png", dpi=(DPI, DPI), compress_level=3)
    for kind, names in (("pdf", ("Creator", "Producer", "CreationDate")), ("svg", ("Creator", "Date"))):
        again.savefig(found[kind], format=kind, metadata=dict.fromkeys(names))
    written = {kind: content.getvalue() for kind, content in found.items()}
    return {**written, "svg": _slim(written["svg"])}


class Recorder:
    """Passes drawing calls on to a renderer, and records each with its pen."""

    def __init__(self, renderer: RendererBase, calls: list[Any]) -> None:
        self._renderer, self._calls = renderer, calls

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever a renderer has
        found = getattr(self._renderer, name)
        if not name.startswith("draw_"):
            return found

        def noted(pen: GraphicsContextBase, *args: Any, **more: Any) -> None:  # noqa: ANN401 - as the renderer is called
            kept = GraphicsContextBase()
            kept.copy_properties(pen)
            self._calls.append((name, kept, args, more))
            found(pen, *args, **more)

        return noted


class Repetition(Figure):
    """Recorded calls that are repeated for other formats, at 72 dots an inch."""

    TRANSFORMS: ClassVar = {  # positions of the arguments that are transforms to dots
        "draw_path": (1,),
        "draw_markers": (1, 3),
        "draw_path_collection": (0, 4),
        "draw_quad_mesh": (0, 5),
    }

    def __init__(self, figure: Figure) -> None:
        super().__init__(figsize=tuple(figure.get_size_inches()), dpi=POINTS)
        self.calls: list[Any] = []

    def draw(self, renderer: RendererBase) -> None:
        """Repeat all calls."""
        smaller = Affine2D().scale(POINTS / DPI)
        for name, kept, noted, more in self.calls:
            pen, args = renderer.new_gc(), list(noted)
            pen.copy_properties(kept)
            if (clip := kept.get_clip_rectangle()) is not None:
                pen.set_clip_rectangle(Bbox(smaller.transform(clip)))
            if name == "draw_text":
                x, y = smaller.transform(args[:2])
                args[:2] = x, y if renderer.flipy() else self.bbox.height - y
            for at in self.TRANSFORMS.get(name, ()):
                args[at] = args[at] + smaller
            getattr(renderer, name)(pen, *args, **more)
            pen.restore()


def _slim(svg: bytes) -> bytes:
    """The same drawing with each letter's shape written once."""
    seen: set[bytes] = set()

    def once(shape: re.Match[bytes]) -> bytes:
        is_new = shape[1] not in seen
        seen.add(shape[1])
        return shape[0] if is_new else b""

    svg = re.sub(rb"<!--.*?-->|<metadata>.*?</metadata>", b"", svg, flags=re.DOTALL)
    svg = re.sub(rb'<path id="(\w+-[0-9a-f]+)"[^>]*?/>', once, svg, flags=re.DOTALL)
    return re.sub(rb"<defs>\s*</defs>|\s*\n\s*", b"\n", svg)


def shades(paper: str = PAPER, middle: str = MIDDLE) -> LinearSegmentedColormap:
    """The colours of shares from 0 to 1."""
    return LinearSegmentedColormap.from_list("shades", [paper, middle, FULL])


@cache
def dark_colours() -> dict[bytes, bytes]:
    """The colours of a dark page by those of a light one."""
    light, dark = shades(), shades(DARK[PAPER], DARK_MIDDLE)
    pairs = {to_hex(light(n)): to_hex(dark(n)) for n in range(light.N)} | DARK
    return {old.encode(): new.encode() for old, new in pairs.items()}


def darkened(svg: bytes) -> bytes:
    """A drawing in colours for a dark page."""
    colours = dark_colours()
    return re.sub(rb"#[0-9a-f]{6}\b", lambda colour: colours.get(colour[0], colour[0]), svg)


def short_name(name: str, most: int = LONGEST_NAME) -> str:
    """A name shortened for a figure: its beginning and its end, by which names are told apart."""
    name, end = visible(name), (most - 1) // 2
    return name if len(name) <= most else f"{name[: most - 1 - end]}…{name[-end:]}"


def share_axis(axes: Axes, *, along: str = "y") -> None:
    """Let an axis show shares from 0 to 100%."""
    axis = axes.yaxis if along == "y" else axes.xaxis
    (axes.set_ylim if along == "y" else axes.set_xlim)(0, 1)
    axis.set_ticks([0, 0.25, 0.5, 0.75, 1], ["0", "25", "50", "75", "100%"])
    axes.grid(visible=True, axis="y" if along == "y" else "x")
