"""Figures look as they did when a person last looked at them, and break on nothing."""

import io
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from made_up_runs import SUITE, cases, made_up
from roboeval.analysis.resample import Prompt, Trial
from roboeval.report.causes import all_causes
from roboeval.report.drawing import DARK, LIGHT, WIDE, Look, looking, new_figure, written
from roboeval.report.figures import LOWEST, at_the_limit, bars, limits, thresholds
from roboeval.report.heat import Heat, causes_figure, draw_heat
from roboeval.report.reading import JudgedRun

PICTURES = Path(__file__).with_name("pictures")
DRAWINGS: dict[str, Callable[[list[JudgedRun], Look], Figure | None]] = {
    "tasks": lambda runs, look: bars(runs, SUITE, look),
    "thresholds": thresholds,
    "causes": lambda runs, look: causes_figure(all_causes(runs, published=True), look),
    "rejection-sampling": limits,
    "accepted": at_the_limit,
}
KEPT: list[Any] = [*(("usual", name) for name in DRAWINGS)]
KEPT += [pytest.param("40 models", name, marks=pytest.mark.slow) for name in DRAWINGS]
KEPT += [("one prompt", "tasks"), ("all failures", "causes"), ("no failures", "causes")]
SIZE = (480, 480)
TOLERANCE = 0.012  # of the whole range, on average over all points


@cache
def picture(case: str, name: str) -> Image.Image | None:
    return drawn_anew(case, name)


def drawn_anew(case: str, name: str) -> Image.Image | None:
    with looking(LIGHT):
        figure = DRAWINGS[name](cases()[case], LIGHT)
        if figure is None:
            return None
        drawn = Image.open(io.BytesIO(written(figure, "png"))).convert("RGB")
    drawn.thumbnail(SIZE)
    return drawn


@pytest.mark.parametrize("name", DRAWINGS)
@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=[pytest.mark.slow] * (case == "40 models")) for case in cases()]
)
def test_nothing_breaks_a_figure(case: str, name: str) -> None:
    drawn = picture(case, name)
    if drawn is None:
        assert case == "all failures"  # whose programs were not checked
        return
    dark = np.asarray(drawn).mean(axis=2) < 128
    assert 0.0005 < dark.mean() < 0.6
    edge = np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]])
    assert edge.mean() < 0.02, "something is cut off"


@pytest.mark.parametrize(("case", "name"), KEPT)
def test_figures_look_as_they_did(case: str, name: str) -> None:
    drawn = picture(case, name)
    assert drawn is not None
    path = PICTURES / f"{case} {name}.png".replace(" ", "-")
    if os.environ.get("REDRAW"):  # then somebody looks at them
        drawn.quantize(64).save(path, optimize=True)
    kept = Image.open(path).convert("RGB")
    assert kept.size == drawn.size
    difference = np.abs(np.asarray(kept, dtype=float) - np.asarray(drawn, dtype=float)).mean() / 255
    assert difference < TOLERANCE


def test_other_numbers_look_different() -> None:
    kept = picture("usual", "causes")
    other = picture("no failures", "causes")
    assert kept is not None
    assert other is not None
    one, two = (np.asarray(drawn.resize((400, 300)), dtype=float) for drawn in (kept, other))
    assert np.abs(one - two).mean() / 255 > TOLERANCE


def test_the_line_through_a_bar_reaches_from_the_worst_prompt_to_the_best() -> None:
    with looking(LIGHT):
        (axes,) = bars([made_up("a", {"Visit": (1, 5, 9), "CountMugs": (4,)})], SUITE, LIGHT).axes
    ends = [np.asarray(line)[:, 1] for lines in axes.collections for line in lines.get_segments()]  # type: ignore[attr-defined]  # error bars are lines
    assert np.allclose(ends, [(0.1, 0.9), (0.4, 0.4)])
    assert np.allclose([bar.get_height() for bar in axes.patches], [0.5, 0.4])  # type: ignore[attr-defined]  # bars are rectangles


@pytest.mark.parametrize("name", ["tasks", "thresholds", "accepted", "rejection-sampling"])
def test_long_names_fit_into_legends(name: str) -> None:
    with looking(LIGHT):
        figure = DRAWINGS[name](cases()["long names"], LIGHT)
        assert figure is not None
        figure.draw_without_rendering()
        (legend,) = figure.legends
        box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1


def test_lines_end_where_the_axis_ends() -> None:
    good, bad = Trial(accepted=True, ran=True, passed=False), Trial(accepted=False, ran=False, passed=True)
    trials = (Prompt("Visit", 0, (good, bad)),)  # whose pass@1 is half, after 100 retries nearly nothing
    run = made_up("a", {"Visit": (1,)}, of=5_000, trials=trials)
    with looking(LIGHT):
        drawn = [thresholds([run], LIGHT), limits([run], LIGHT)]
    for figure in drawn:
        assert figure is not None
        lines = [np.asarray(line.get_xdata()) for axes in figure.axes for line in axes.lines]
        assert {float(xs.min()) for xs in lines} == {float(xs[-1]) for xs in lines} == {LOWEST}


@pytest.mark.parametrize("look", [LIGHT, DARK], ids=["light", "dark"])
def test_numbers_stand_out_from_their_shades(look: Look) -> None:
    shares = [n / 100 for n in range(101)]
    with looking(look):
        figure = new_figure(WIDE, WIDE)
        axes = figure.add_subplot()
        draw_heat(axes, Heat([[share] for share in shares], [""] * len(shares), [""]), look)
        figure.draw_without_rendering()
        shades = np.asarray(axes.collections[0].get_facecolor())
    for text, shade in zip(axes.texts, shades, strict=True):
        one, other = sorted((light(to_rgb(text.get_color())), light((shade[0], shade[1], shade[2]))))
        assert (other + 0.05) / (one + 0.05) > 4


def light(colour: tuple[float, float, float]) -> float:
    """How light a colour is, as the guidelines for accessible pages reckon it."""
    parts = [v / 12.92 if v <= 0.03928 else ((v + 0.055) / 1.055) ** 2.4 for v in colour]
    return float(np.dot(parts, [0.2126, 0.7152, 0.0722]))


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_the_same_numbers_give_the_same_bytes(kind: str) -> None:
    def drawn() -> bytes:
        with looking(DARK):
            figure = bars(cases()["usual"], SUITE, DARK)
            return written(figure, kind)

    first = drawn()
    assert first == drawn()
    assert b"CreationDate" not in first
    assert b"<dc:date>" not in first


def test_a_readers_own_style_plays_no_part(monkeypatch: pytest.MonkeyPatch) -> None:
    before = drawn_anew("one prompt", "tasks")
    monkeypatch.setitem(mpl.rcParams, "axes.facecolor", "red")
    after = drawn_anew("one prompt", "tasks")
    assert before is not None
    assert after is not None
    assert before.tobytes() == after.tobytes()
