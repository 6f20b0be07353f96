"""Figures look as they did at the last review, and no case breaks them."""

import io
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, cast

import matplotlib as mpl
import numpy as np
import polars as pl
import pytest
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from PIL import Image

from made_up_runs import cases, new_run
from roboeval.analysis.metrics import overall
from roboeval.analysis.resample import LIMITS, accepted_after
from roboeval.evaluation.judging.failures import FAILURE_CLASSES, FailureClass
from roboeval.report.figures.bars import (
    WORST_AND_BEST,
    draw_causes,
    draw_heat_map,
    draw_overall,
    draw_task_scores,
)
from roboeval.report.figures.curves import draw_accepted, draw_limits, draw_thresholds, most_completions
from roboeval.report.figures.drawing import (
    COLOURS,
    PAGE_WIDTH,
    new_figure,
    render,
    shades,
    use_style,
)
from roboeval.report.runs import JudgedRun, runs_to_draw
from roboeval.report.sections.cost import retry_curves
from roboeval.report.sections.failures import all_causes

PICTURES = Path(__file__).with_name("pictures")
DRAWINGS: dict[str, Callable[[list[JudgedRun]], Figure]] = {
    "overall": draw_overall,
    "tasks": draw_task_scores,
    "thresholds": draw_thresholds,
    "causes": lambda runs: draw_causes(all_causes(runs, with_published=True)),
    "rejection-sampling": lambda runs: draw_limits(
        {run.name: retry_curves(run.checked) for run in runs}, most_completions(runs)
    ),
    "accepted": lambda runs: draw_accepted(
        {run.name: accepted_after(run.checked, LIMITS[-1]) for run in runs}
    ),
}
KEPT: list[Any] = [*(("usual", name) for name in DRAWINGS)]
KEPT += [
    ("40 models", "overall"),
    ("one prompt", "tasks"),
    ("one prompt", "overall"),
    ("without programs", "causes"),
]
KEPT += [("all failures", "causes"), ("no failures", "causes")]
SIZE = (480, 480)
TOLERANCE = 0.012  # A share of the whole range, averaged over all points.


@cache
def picture(case: str, name: str) -> Image.Image:
    return draw_picture(case, name)


def draw_picture(case: str, name: str) -> Image.Image:
    runs = cases()[case]
    with use_style():
        figure = DRAWINGS[name](runs if name == "overall" else runs_to_draw(runs)[0])
        figure.savefig(file := io.BytesIO(), format="png")  # Two more formats would take twice as long.
    drawn = Image.open(file).convert("RGB")
    drawn.thumbnail(SIZE)
    return drawn


@pytest.mark.parametrize(
    ("case", "name"),
    [
        pytest.param(case, name, marks=[pytest.mark.slow] * (case != "usual"))
        for case, runs in cases().items()
        for name in DRAWINGS
        if runs[0].checked or name not in {"accepted", "rejection-sampling"}
    ],
)
def test_no_case_breaks_a_figure(case: str, name: str) -> None:
    drawn = picture(case, name)
    dark = np.asarray(drawn).mean(axis=2) < 128
    assert 0.0005 < dark.mean() < 0.6
    edge = np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]])
    assert edge.mean() < 0.02, "something is cut off"


@pytest.mark.slow
@pytest.mark.parametrize(("case", "name"), KEPT)
def test_figures_look_as_they_did(case: str, name: str) -> None:
    drawn = picture(case, name)
    path = PICTURES / f"{case} {name}.png".replace(" ", "-")
    if os.environ.get("REDRAW"):  # A person reviews them then.
        drawn.quantize(64).save(path, optimize=True)
    kept = Image.open(path).convert("RGB")
    assert kept.size == drawn.size
    difference = np.abs(np.asarray(kept, dtype=float) - np.asarray(drawn, dtype=float)).mean() / 255
    assert difference < TOLERANCE


def test_figures_show_the_best_of_many_runs() -> None:
    runs = cases()["40 models"]
    drawn, (note,) = runs_to_draw(runs)
    assert len(drawn) == 8
    assert min(run.mean for run in drawn) >= max(run.mean for run in runs if run not in drawn)
    assert drawn == [run for run in runs if run in drawn]
    assert "8 best of 40 runs" in note
    assert runs_to_draw(runs[:8]) == (runs[:8], [])


@pytest.mark.slow
def test_other_numbers_look_different() -> None:
    kept = picture("usual", "causes")
    other = picture("no failures", "causes")
    one, two = (np.asarray(drawn.resize((400, 300)), dtype=float) for drawn in (kept, other))
    assert np.abs(one - two).mean() / 255 > TOLERANCE


def test_a_further_class_of_failures_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    one = FailureClass("RuleError", "broken rule", "broken rules", ())
    monkeypatch.setitem(cast("dict[str, FailureClass]", FAILURE_CLASSES), one.name, one)
    with use_style():
        figure = DRAWINGS["causes"](cases()["usual"])
    assert [axes.get_title(loc="left") for axes in figure.axes][-1] == "(e) broken rules"
    _, labels = figure.axes[0].get_legend_handles_labels()
    assert labels[-1] == "broken rules"


def test_the_class_without_programs_is_drawn_only_if_it_occurs() -> None:
    def titles(case: str) -> list[str]:
        with use_style():
            figure = DRAWINGS["causes"](cases()[case])
        return [axes.get_title(loc="left") for axes in figure.axes]

    assert "(b) Python errors" in titles("usual")
    assert titles("without programs")[1:3] == ["(b) without a program", "(c) Python errors"]


def test_classes_keep_their_colours() -> None:
    def colours(case: str) -> dict[str, Any]:
        with use_style():
            figure = DRAWINGS["causes"](cases()[case])
        handles, labels = figure.axes[0].get_legend_handles_labels()
        found: list[Any] = list(handles)
        return {label: to_hex(bars[0].get_facecolor()) for label, bars in zip(labels, found, strict=True)}

    usual, more = colours("usual"), colours("without programs")
    assert usual.items() <= more.items()
    assert {*more} - {*usual} == {"without a program"}


def test_whisker_is_the_interval_and_marks_are_the_worst_and_the_best_prompt() -> None:
    run = new_run("a", {"Visit": (4, 5, 6), "CountMugs": (4,), "BringTea": (3, 3, 3)})
    with use_style():
        (axes,) = draw_task_scores([run]).axes
    (ends,) = [np.asarray(line)[:, 1] for lines in axes.collections for line in lines.get_segments()]  # type: ignore[attr-defined]  # error bars are lines
    passed = run.scores[0].pass_at(1)
    assert np.allclose(ends, (passed.low, passed.high)), "the others have no known interval"
    (marks,) = [line for line in axes.lines if line.get_marker() == "D"]
    assert sorted(np.asarray(marks.get_ydata()).round(9)) == [0.3, 0.4, 0.6]
    assert np.allclose([bar.get_height() for bar in axes.patches], [0.5, 0.4, 0.3])  # type: ignore[attr-defined]  # bars are rectangles
    assert axes.figure.legends[0].get_texts()[-1].get_text() == WORST_AND_BEST


def test_overall_figure_has_the_interval_over_tasks() -> None:
    runs = cases()["usual"]
    with use_style():
        (axes,) = draw_overall(runs).axes
    passed = [overall(run.scores, 1) for run in runs]
    ends = [np.asarray(line)[:, 0] for lines in axes.collections for line in lines.get_segments()]  # type: ignore[attr-defined]  # error bars are lines
    assert np.allclose(ends, [(one.low, one.high) for one in passed])
    assert np.allclose([bar.get_width() for bar in axes.patches], [one.mean for one in passed])  # type: ignore[attr-defined]  # bars are rectangles


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tasks", "thresholds", "accepted", "rejection-sampling"])
def test_long_names_fit_into_legends(name: str) -> None:
    with use_style():
        figure = DRAWINGS[name](cases()["long names"])
        figure.draw_without_rendering()
        (legend,) = figure.legends
        box = legend.get_window_extent()
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.x1


def test_lines_end_where_the_axis_ends() -> None:
    run = new_run("a", {"Visit": (1,), "Wait": (0,)}, of=50)
    other = new_run("b", {"Visit": (5,)}, accepted=~pl.col("passed"))  # After 100 retries almost none passes.
    with use_style():
        drawn = {1 / 50: draw_thresholds([run]), 1 / 10: draw_limits({"b": retry_curves(other.checked)}, 10)}
    for end, figure in drawn.items():
        ticks = [text.get_text() for text in figure.axes[0].get_xticklabels()]
        assert (ticks[0], ticks[-1]) == ("1", f"1/{1 / end:.0f}")
        lines = [
            np.asarray(line.get_xdata())
            for axes in figure.axes
            for line in axes.lines
            if line.get_linestyle() != "None"
        ]
        assert {float(xs.min()) for xs in lines} == {float(xs[-1]) for xs in lines} == {end}


def test_numbers_are_legible_on_their_shades() -> None:
    shares = [n / 100 for n in range(101)]
    with use_style():
        figure = new_figure(PAGE_WIDTH, PAGE_WIDTH)
        axes = figure.add_subplot()
        draw_heat_map(axes, [[share] for share in shares], [""] * len(shares), [""])
        figure.draw_without_rendering()
        cells = np.asarray(axes.collections[0].get_facecolor())
    for text, cell in zip(axes.texts, cells, strict=True):
        one, other = sorted((luminance(to_rgb(text.get_color())), luminance(to_rgb(to_hex(cell)))))
        assert (other + 0.05) / (one + 0.05) > 4, (text.get_text(), text.get_color(), cell)


def test_each_colour_has_one_meaning() -> None:
    shaded = {to_hex(shades()(n)) for n in range(1, 256)}
    assert len(shaded) == 255
    assert not shaded & {colour.lower() for colour in COLOURS}


def luminance(colour: tuple[float, float, float]) -> float:
    """Compute the luminance of a colour as the guidelines for accessible pages do."""
    parts = [v / 12.92 if v <= 0.03928 else ((v + 0.055) / 1.055) ** 2.4 for v in colour]
    return float(np.dot(parts, [0.2126, 0.7152, 0.0722]))


@pytest.mark.slow
def test_the_same_numbers_give_the_same_bytes() -> None:
    def draw() -> dict[str, bytes]:
        with use_style():
            return render(draw_task_scores(cases()["usual"]))

    first = draw()
    assert set(first) == {"png", "pdf", "svg"}
    assert first == draw()
    for kind in first.values():
        assert b"CreationDate" not in kind
        assert b"<dc:date>" not in kind


@pytest.mark.slow
def test_a_users_own_style_has_no_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    before = draw_picture("one prompt", "tasks")
    monkeypatch.setitem(mpl.rcParams, "axes.facecolor", "red")
    after = draw_picture("one prompt", "tasks")
    assert before.tobytes() == after.tobytes()
