"""Sections on failures: causes, groups of similar ones, and verdicts by another suite."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.analysis.cluster import Cluster, clusters, groups
from roboeval.analysis.counts import tally_of
from roboeval.analysis.summary import ALL, Causes, causes, cut_off
from roboeval.analysis.summary import failures as counted_failures
from roboeval.analysis.verdict_changes import VerdictChanges, place, sentences, verdict_changes
from roboeval.evaluation.failures import plural_of
from roboeval.evaluation.runs.completions import name_of
from roboeval.report import figures, paper
from roboeval.report.runs import JudgedRun, coverage_of
from roboeval.report.sheets import Cell, Groups, Picture, Prose, Section, Sheet, note, section, sheet
from roboeval.suites.task import check_label

MOST, FEWEST, ALTOGETHER = 100, 4, 200  # groups to show of a run, and of all runs
MOST_REVERSALS = 100  # groups of each run


# --- causes


def why(runs: Sequence[JudgedRun], *, with_published: bool) -> Section:
    """How completions end (paper, section V.B)."""
    found = all_causes(runs, with_published=with_published)
    picture = Picture("causes", lambda: figures.causes(found), coverage_of(runs))
    notes = Prose(beside_notes(runs) if with_published else [])
    return section("causes", picture, notes, causes_sheet(found))


def all_causes(runs: Sequence[JudgedRun], *, with_published: bool) -> list[tuple[str, Causes]]:
    """The causes of each run, each followed by the published ones if they are wanted and known."""
    found: list[tuple[str, Causes]] = []
    for run in runs:
        found.append((run.name, causes(tally_of(run.table))))
        if with_published and (model := paper.model_of(run)) is not None:
            found.append((f"{run.name}, published", paper.causes(model)))
    return found


def most_frequent(run: JudgedRun) -> str:
    """The most frequent kind of failure with its share of all completions, in words; empty if none fails."""
    counts = {key: count for key, count in causes(tally_of(run.table)).counts.items() if key[1] != ALL}
    if not counts:
        return ""
    (of, kind), count = max(counts.items(), key=lambda one: one[1])
    return f"{kind} ({plural_of(of)}), {count / run.completions.height:.0%} of all completions"


def warnings(run: JudgedRun) -> list[str]:
    """What a reader of the run's numbers must know: many replies that were cut off."""
    warning = cut_off(counted_failures(tally_of(run.table)), run.results.scope).warning
    return [] if warning is None else [f"{warning}."]


def causes_sheet(found: Sequence[tuple[str, Causes]]) -> Sheet:
    """All shares and counts."""
    rows = [
        [name, of, kind, one.counts.get((of, kind)), share]
        for name, one in found
        for of, whole in one.classes.items()
        for kind, share in [(ALL, whole), *one.kinds.get(of, {}).items()]
    ]
    return sheet("causes", rows)


def beside_notes(runs: Sequence[JudgedRun]) -> list[str]:
    """Caveats where published causes stand beside ours."""
    known = [run for run in runs if paper.model_of(run) is not None]
    if not known:
        return ["None of these runs names a model of the paper, so no published causes are shown."]
    tasks = {*paper.published()["pass_at_1"]}
    parts = ", ".join(run.name for run in known if {score.task for score in run.scores} != tasks)
    more = f"Published causes are of all {len(tasks)} tasks of the paper, which is more than {parts} did."
    return [*paper.taken_for(runs), note("two-sums"), *([more] if parts else [])]


# --- groups


def alike(runs: Sequence[JudgedRun]) -> Section:
    """Groups of failures of all runs; of each run, the page shows the largest with their programs."""
    most = max(FEWEST, min(MOST, ALTOGETHER // len(runs)))
    every: list[tuple[str, Cluster]] = []
    shown: list[tuple[str, Cluster]] = []
    notes: list[str] = []
    for run in runs:
        together = groups(map(run.results.failed_row, run.results.failed), run.results.programs)
        named = [(run.name, one) for one in clusters(together, run.results)]
        every += named
        shown += named[:most]
        if len(named) > most:
            notes.append(f"{run.name}: {most:,} of {len(named):,} groups are shown; the table below has all.")
    about = Prose([note("groups"), *notes] if shown else [])
    return section("failures", about, Groups(shown), groups_sheet(every))


def groups_sheet(every: Sequence[tuple[str, Cluster]]) -> Sheet:
    """The groups as numbers."""
    rows = [
        [name, len(one.members), *_cells(one), one.fix and one.fix.name, one.fix and one.fix.changed]
        for name, one in every
    ]
    return sheet("failures", rows)


def _cells(one: Cluster) -> list[Cell]:
    check = one.failure["check"]
    ground = [one.failure["class"], one.failure["kind"], check and check_label(check)]
    return [one.task, *ground, one.why, name_of(one.representative)]


# --- other checks


def beside(runs: Sequence[JudgedRun]) -> Section:
    """What the verdicts of another suite change."""
    found = [verdict_changes(run.name, run.results, run.beside) for run in runs if run.beside is not None]
    sheets = changes_sheet(found), changed_tasks_sheet(found), reversals_sheet(found)
    return section("beside", Prose(sentences(found)), *sheets)


def changes_sheet(found: Sequence[VerdictChanges]) -> Sheet:
    """pass@1 by both suites."""
    here, there = ({one.name: one.pass_at_1[side] for one in found} for side in (0, 1))
    rows: list[list[Cell]] = []
    for one in found:
        before, after = one.pass_at_1
        over = one.comparison.over_tasks
        places = place(one.name, here), place(one.name, there)
        rows.append([one.name, before, after, after - before, over.low, over.high, *places])
    return sheet("beside", rows)


def changed_tasks_sheet(found: Sequence[VerdictChanges]) -> Sheet:
    """How many completions pass by which of both suites."""
    rows = [
        [task.task, one.name, task.both, task.first_only, task.second_only, task.neither]
        for one in found
        for task in one.tasks
    ]
    return sheet("beside-tasks", rows)


def reversals_sheet(found: Sequence[VerdictChanges]) -> Sheet:
    """Groups of completions that pass by one of the suites only."""
    rows: list[list[Cell]] = []
    notes: list[str] = []
    for one in found:
        sides = zip(one.suites, (one.first_only, one.second_only), strict=True)
        those = [(suite, group) for suite, groups in sides for group in groups]
        those.sort(key=lambda pair: -len(pair[1].members))
        for suite, group in those[:MOST_REVERSALS]:
            rows.append([one.name, f"{suite} only", len(group.members), *_cells(group)])
        if (left := len(those) - MOST_REVERSALS) > 0:
            more = f"{left:,} more groups are left out; `roboeval compare --suites` shows them."
            notes.append(f"{one.name}: {more}")
    return sheet("reversals", rows, notes=notes)
