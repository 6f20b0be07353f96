"""What a report holds, section by section, before anything is drawn or written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

from matplotlib.figure import Figure

from roboeval.evaluation.completions import how_many
from roboeval.report import (
    beside,
    causes,
    cost,
    differences,
    failures,
    figures,
    heat,
    origin,
    paper,
    retries,
    robustness,
    scores,
    strengths,
)
from roboeval.report.cost import Price
from roboeval.report.drawing import Look
from roboeval.report.failures import Failures
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Sheet
from roboeval.suites.load import Suite


@dataclass(frozen=True)
class Picture:
    """A figure.

    Args:
        name: of its files, without the ending.
        caption: what it shows, in sentences.
        draw: draws it in some colours; None where there is nothing to draw.
    """

    name: str
    caption: str
    draw: Callable[[Look], Figure | None]


@dataclass(frozen=True)
class Prose:
    """Paragraphs of plain text."""

    paragraphs: tuple[str, ...]


@dataclass(frozen=True)
class Code:
    """A text whose lines and spaces count, such as a command."""

    text: str


Part: TypeAlias = Sheet | Picture | Prose | Code | Failures


@dataclass(frozen=True)
class Section:
    """A section of the page.

    Args:
        name: by which links find it.
        title: its heading.
        parts: in their order.
    """

    name: str
    title: str
    parts: tuple[Part, ...] = field(default=())


@dataclass(frozen=True)
class Wishes:
    """What whoever asks for a report may choose.

    Args:
        published: whether the published failures stand beside ours.
        prices: of models.
        command: that makes the report.
    """

    published: bool = False
    prices: tuple[Price, ...] = ()
    command: str = ""


def headline(runs: Sequence[JudgedRun], suite: Suite) -> tuple[str, list[str]]:
    """The title of a page, and what stands below it.

    Args:
        runs: at least one.
        suite: by which they were judged.
    """
    title = runs[0].name if len(runs) == 1 else f"{len(runs)} models"
    count = how_many(sum(run.completions.height for run in runs))
    by_hand = [run.name for run in runs if (run.model or "").startswith("recorded:")]
    lead = [f"{count}, judged by the suite \u201c{suite.name}\u201d: {suite.about}."]
    if by_hand:
        lead.append(f"Programs of {', '.join(by_hand)} were written by hand, and stand for no model.")
    return f"Robot programs by {title}", lead


def sections(runs: Sequence[JudgedRun], suite: Suite, wishes: Wishes) -> list[Section]:
    """All sections of a report.

    Args:
        runs: judged by this suite, named apart, at least one.
        suite: by which they were judged.
        wishes: what else was asked for.
    """
    found = [
        _results(runs, suite),
        _differences(runs),
        _beside(runs),
        _thresholds(runs),
        _causes(runs, published=wishes.published),
        _failures(runs),
        _strengths(runs, suite),
        _phrasing(runs, suite),
        _retries(runs),
        _cost(runs, wishes.prices),
        _cells(runs, suite),
        _origin(runs, suite, wishes.command),
    ]
    return [section for section in found if section.parts]


def _parts(*parts: Part | None) -> tuple[Part, ...]:
    return tuple(part for part in parts if part is not None)


def _results(runs: Sequence[JudgedRun], suite: Suite) -> Section:
    picture = Picture(
        "tasks",
        "pass@1 by task and model. A bar is the mean over the prompts of a task; its line reaches from the "
        "worst prompt to the best; a dot stands for 0, and nothing for a task that was not judged. Where it "
        "was judged, the same tasks with the requirements of common sense only stand beside it.",
        lambda look: figures.bars(runs, suite, look),
    )
    parts = (scores.overall_sheet(runs), picture, scores.task_sheet(runs, suite))
    return Section("results", "How often programs pass", parts)


def _thresholds(runs: Sequence[JudgedRun]) -> Section:
    picture = Picture(
        "thresholds",
        "The share of prompts whose pass@1 is at least the threshold, which falls from 1 on the left. A "
        "perfect model is a line at 100 %; where a line ends below that, no completion of the other prompts "
        "passes.",
        lambda look: figures.thresholds(runs, look),
    )
    return Section("thresholds", "How many prompts it can do", (picture, scores.curve_sheet(runs)))


def _causes(runs: Sequence[JudgedRun], *, published: bool) -> Section:
    found = causes.all_causes(runs, published=published)
    picture = Picture(
        "causes",
        "Causes of failures. (a) How completions end, in shares of all. (b) to (d) Of the failures of a "
        "class, the share of each kind in percent, by model; a model without such failures is left out.",
        lambda look: heat.causes_figure(found, look),
    )
    table = causes.causes_sheet(found)
    notes = causes.beside_notes(runs) if published else []
    return Section(
        "causes", "Why programs fail", _parts(picture, Prose(tuple(notes)) if notes else None, table)
    )


def _retries(runs: Sequence[JudgedRun]) -> Section:
    curves = Picture(
        "rejection-sampling",
        "The share of prompts by threshold of pass@1 where a program that the check rejects is asked for "
        "again, by the limit of retries.",
        lambda look: figures.limits(runs, look),
    )
    steps = Picture(
        "accepted",
        "The share of programs that the check accepts by the limit of retries; the others run against it.",
        lambda look: figures.at_the_limit(runs, look),
    )
    limits, points, accepted = (
        retries.retries_sheet(runs),
        retries.curves_sheet(runs),
        retries.steps_sheet(runs),
    )
    parts = () if limits is None else _parts(curves, limits, steps, points, accepted)
    return Section("rejection-sampling", "What rejection sampling would give", parts)


def _cells(runs: Sequence[JudgedRun], suite: Suite) -> Section:
    beside = scores.published_sheet(runs, suite)
    unknown = [run.name for run in runs if paper.model_of(run) is None]
    prose = None
    if beside is not None and unknown:
        names = ", ".join(unknown)
        prose = Prose((f"No published numbers of {names}: no model of the paper is called so.",))
    parts = _parts(scores.prompt_sheet(runs, suite), beside, prose)
    return Section("prompts", "Every prompt, and the paper", parts)


def _differences(runs: Sequence[JudgedRun]) -> Section:
    found = differences.difference_sheet(runs)
    parts = () if found is None else (Prose(tuple(found[1])), found[0])
    return Section("differences", "Which is better", parts)


def _beside(runs: Sequence[JudgedRun]) -> Section:
    found = beside.reversed_in(runs)
    parts = _parts(Prose(beside.sentences(found)), *beside.sheets(found)) if found else ()
    return Section("beside", "What other checks change", parts)


def _failures(runs: Sequence[JudgedRun]) -> Section:
    found = failures.failures(runs)
    if not found.shown:
        return Section("failures", "What went wrong")
    parts = _parts(
        Prose((failures.ABOUT,)),
        found,
        Prose(found.notes) if found.notes else None,
        failures.failures_sheet(found),
    )
    return Section("failures", "What went wrong", parts)


def _strengths(runs: Sequence[JudgedRun], suite: Suite) -> Section:
    back = strengths.coming_back_sheet(runs, suite)
    said = Prose(tuple(strengths.coming_back_said(back))) if back is not None else None
    parts = _parts(strengths.ability_sheet(runs, suite), said, back)
    return Section("abilities", "Which ability is missing", parts)


def _phrasing(runs: Sequence[JudgedRun], suite: Suite) -> Section:
    found = robustness.spread_sheet(runs, suite), robustness.phrasing_sheet(runs, suite)
    return Section("phrasing", "How much phrasing matters", tuple(one for one in found if one.rows))


def _cost(runs: Sequence[JudgedRun], prices: Sequence[Price]) -> Section:
    parts = _parts(cost.cost_sheet(runs, prices), cost.budget_sheet(runs, prices))
    return Section("cost", "What it costs", parts)


def _origin(runs: Sequence[JudgedRun], suite: Suite, command: str) -> Section:
    parts = (origin.origin_sheet(runs), Prose(origin.about_suite(suite, runs)), Code(command))
    return Section("origin", "Where this comes from", parts)
