"""Why programs fail: shares of classes and kinds of failures, by model (section V.B of the paper)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

from roboeval.analysis.summary import failures
from roboeval.evaluation.failures import CLASSES
from roboeval.report import paper
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Column, Sheet, sheet

PASSED = "passed"
ABOUT = (
    "A completion fails for one reason: the error, or else the first failed check, of the first world that "
    "it does not satisfy. Shares of classes are of all completions, shares of kinds of the failures of their "
    "class."
)


@dataclass(frozen=True)
class Causes:
    """How the completions of one model ended.

    Args:
        name: of the run; with ", published" where the numbers are the paper's.
        classes: the share of all completions by class, of those that passed as well.
        kinds: by class, the share of its failures by kind; empty where nothing failed by it.
        counts: of completions by class and kind; None where only shares are known.
    """

    name: str
    classes: Mapping[str, float]
    kinds: Mapping[str, Mapping[str, float]]
    counts: Mapping[tuple[str, str], int] | None = None


def causes_of(run: JudgedRun) -> Causes:
    """Count how the completions of a run ended."""
    found = failures(run.table)
    passed = 1 - sum(one.count for one in found) / run.completions.height
    kinds = {
        one.name: {kind.name: kind.count for kind in sorted(one.kinds, key=attrgetter("name")) if kind.count}
        for one in found
    }
    return Causes(
        run.name,
        {PASSED: passed, **{one.name: one.share for one in found}},
        {one.name: {kind: n / one.count for kind, n in kinds[one.name].items()} for one in found},
        {(name, kind): n for name, counts in kinds.items() for kind, n in counts.items()},
    )


def published_causes(run: JudgedRun) -> Causes | None:
    """What the paper's authors published of the model that a run names; None if it names another."""
    model = paper.model_of(run)
    if model is None:
        return None
    shares = {PASSED: paper.class_share(model, None)}
    shares |= {name: paper.class_share(model, name) for name in CLASSES}
    kinds = {
        name: {kind: share for kind, share in paper.kind_shares(model, name).items() if share}
        for name in CLASSES
    }
    return Causes(f"{run.name}, published", shares, kinds)


def all_causes(runs: Sequence[JudgedRun], *, published: bool) -> list[Causes]:
    """The causes of each run, each followed by the published ones if they are asked for and there."""
    found: list[Causes] = []
    for run in runs:
        found.append(causes_of(run))
        theirs = published_causes(run) if published else None
        found += [theirs] if theirs is not None else []
    return found


def kinds_in_order(causes: Sequence[Causes], failure_class: str) -> list[str]:
    """The kinds of a class that some model fails by, known ones first."""
    there = {kind for one in causes for kind in one.kinds.get(failure_class, {})}
    known = [kind for kind in CLASSES[failure_class].kinds if kind in there]
    return [*known, *sorted(there - set(known))]


def causes_sheet(causes: Sequence[Causes]) -> Sheet:
    """All shares and counts."""
    columns = [
        Column("model"),
        Column("class"),
        Column("kind"),
        Column("completions", "count"),
        Column("share", "share"),
    ]
    rows: list[list[str | int | float | None]] = []
    for one in causes:
        for name, share in one.classes.items():
            rows.append([one.name, name, "all", _count(one, name), share])
            rows += [
                [one.name, name, kind, None if one.counts is None else one.counts[name, kind], part]
                for kind, part in one.kinds.get(name, {}).items()
            ]
    return sheet("causes", "Causes of failures", columns, rows, about=ABOUT)


def beside_notes(runs: Sequence[JudgedRun]) -> list[str]:
    """What a reader must know where published causes stand beside ours."""
    known = [run for run in runs if paper.model_of(run) is not None]
    if not known:
        return ["None of these runs names a model of the paper, so no published causes stand beside them."]
    all_tasks = set(paper.published()["pass_at_1"])
    parts = [run.name for run in known if set(run.by_task) != all_tasks]
    notes = [*paper.taken_for(runs), paper.TWO_SUMS]
    if parts:
        notes.append(
            f"Published causes are of all {len(all_tasks)} tasks of the paper, which is more than "
            f"{', '.join(parts)} did."
        )
    return notes


def _count(one: Causes, failure_class: str) -> int | None:
    if one.counts is None or failure_class == PASSED:
        return None
    return sum(count for (name, _), count in one.counts.items() if name == failure_class)
