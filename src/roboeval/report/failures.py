"""Groups of failures for the page: who fails alike, why, and what would have helped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from roboeval.analysis.cluster import Cluster, clusters, groups
from roboeval.evaluation.completions import how_many, name_of
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Column, Sheet, sheet

MOST, FEWEST, ALTOGETHER = 25, 4, 200  # groups that are shown of a run, and of all runs
ABOUT = (
    "Completions of one task that fail by the same error or check and with similar programs, the largest "
    "groups first. Two programs are similar if they share six in ten of their lines, whatever names they "
    "chose. A group is shown by its most frequent program, beside the program of the same task that passes "
    "and differs in the fewest lines."
)


@dataclass(frozen=True)
class Shown:
    """A group of failures of one run."""

    model: str
    cluster: Cluster


@dataclass(frozen=True)
class Failures:
    """The largest groups of failures of all runs.

    Args:
        shown: of each run in turn, the largest first.
        notes: how many more there are.
    """

    shown: tuple[Shown, ...]
    notes: tuple[str, ...]


def failures(runs: Sequence[JudgedRun]) -> Failures:
    """Put the failures of each run together.

    Args:
        runs: at least one.
    """
    most = max(FEWEST, min(MOST, ALTOGETHER // len(runs)))
    shown: list[Shown] = []
    notes: list[str] = []
    for run in runs:
        together = groups(run.results.failed.values(), run.results.programs)
        told = clusters(together[:most], run.results)
        shown += [Shown(run.name, cluster) for cluster in told]
        notes += _left_out(run, [len(rows) for rows in together[most:]])
    return Failures(tuple(shown), tuple(notes))


def _left_out(run: JudgedRun, sizes: Sequence[int]) -> Iterator[str]:
    if sizes:
        those = f"{len(sizes):,} smaller groups with {how_many(sum(sizes))}"
        yield f"{run.name}: {those} are left out; `roboeval find` shows as many as --groups says."


def failures_sheet(found: Failures) -> Sheet:
    """The groups as numbers."""
    columns = (
        Column("model"),
        Column("completions", "count"),
        Column("task"),
        Column("class"),
        Column("kind"),
        Column("check"),
        Column("why"),
        Column("such as"),
        Column("passes"),
        Column("lines apart", "count"),
    )
    rows = [
        [
            one.model,
            len(one.cluster.members),
            one.cluster.task,
            one.cluster.failure["class"],
            one.cluster.failure["kind"],
            one.cluster.failure["check"],
            one.cluster.why,
            name_of(one.cluster.representative),
            None if one.cluster.fix is None else one.cluster.fix.name,
            None if one.cluster.fix is None else one.cluster.fix.changed,
        ]
        for one in found.shown
    ]
    return sheet("failures", "The same as a table", columns, rows)
