"""Builds the sections on failures, and on verdicts under another suite or under house rules."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.analysis.comparisons.verdict_changes import ranks, sentences, verdict_changes
from roboeval.analysis.counting.broken_rules import count_broken_rules
from roboeval.analysis.counting.counts import tally_of, task_scores
from roboeval.analysis.counting.summary import ALL, Causes, causes
from roboeval.analysis.failure_groups import FailureGroup, describe_groups, group_failures
from roboeval.analysis.metrics import overall
from roboeval.evaluation.judging.failures import plural_of
from roboeval.evaluation.runs.completions import name_of
from roboeval.report import paper
from roboeval.report.figures import bars as figures
from roboeval.report.runs import JudgedRun, coverage_of, runs_to_draw
from roboeval.report.sheets import Cell, Groups, Prose, ReportFigure, Section, Sheet, note, section, sheet
from roboeval.suites.task import plain_check

MAX_GROUPS_PER_RUN, MIN_GROUPS_PER_RUN = 100, 4  # number of groups of a run on the page
MAX_GROUPS_SHOWN = 200  # number of groups on the page


# --- causes


def causes_section(runs: Sequence[JudgedRun], *, with_published: bool) -> Section:
    """Build the section on causes of failures. `with_published` adds those in the paper (section V.B)."""
    drawn, left_out = runs_to_draw(runs)
    shown = all_causes(drawn, with_published=with_published)
    figure = ReportFigure("causes", lambda: figures.draw_causes(shown), [*coverage_of(runs), *left_out])
    notes = Prose(published_notes(runs) if with_published else [])
    return section("causes", figure, notes, causes_sheet(all_causes(runs, with_published=with_published)))


def all_causes(runs: Sequence[JudgedRun], *, with_published: bool) -> list[tuple[str, Causes]]:
    """Return (name, causes of failures) of each run and, if `with_published`, of its model in the paper."""
    found: list[tuple[str, Causes]] = []
    for run in runs:
        found.append((run.name, causes(tally_of(run.table))))
        if with_published and (model := paper.model_of(run)) is not None:
            found.append((f"{run.name}, published", paper.causes(model)))
    return found


def most_frequent(run: JudgedRun) -> str:
    """Describe the most frequent kind of failure. Return an empty string if no completion fails."""
    counts = {key: count for key, count in causes(tally_of(run.table)).counts.items() if key[1] != ALL}
    if not counts:
        return ""
    (name, kind), count = max(counts.items(), key=lambda one: one[1])
    return f"{kind} ({plural_of(name)}), {count / run.completions.height:.0%} of all completions"


def causes_sheet(found: Sequence[tuple[str, Causes]]) -> Sheet:
    """Build the table of causes with their counts and shares, given pairs of a run's name and its causes."""
    rows = [
        [name, cause, kind, one.counts.get((cause, kind)), share]
        for name, one in found
        for cause, whole in one.classes.items()
        for kind, share in [(ALL, whole), *one.kinds.get(cause, {}).items()]
    ]
    return sheet("causes", rows)


def published_notes(runs: Sequence[JudgedRun]) -> list[str]:
    """Return notes on how comparable the runs' causes of failure are with those published in the paper."""
    known = [run for run in runs if paper.model_of(run) is not None]
    if not known:
        return ["None of these runs uses a model of the paper, so no published causes are shown."]
    tasks = {*paper.published()["pass_at_1"]}
    parts = ", ".join(run.name for run in known if {score.task for score in run.scores} != tasks)
    more = f"Published causes cover all {len(tasks)} tasks of the paper; fewer were judged for {parts}."
    return [*paper.recognised_models(runs), note("two-sums"), *([more] if parts else [])]


# --- groups


def failures_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on groups of similar failures. The page shows the largest groups of each run."""
    most = max(MIN_GROUPS_PER_RUN, min(MAX_GROUPS_PER_RUN, MAX_GROUPS_SHOWN // len(runs)))
    every: list[tuple[str, FailureGroup]] = []
    shown: list[tuple[str, FailureGroup]] = []
    notes: list[str] = []
    for run in runs:
        groups = group_failures(map(run.results.row, run.results.failed), run.results.programs)
        named = [(run.name, one) for one in describe_groups(groups, run.results)]
        every += named
        shown += named[:most]
        if len(named) > most:
            notes.append(f"{run.name}: {most:,} of {len(named):,} groups are shown here; the table has all.")
    about = Prose([note("groups"), *notes] if shown else [])
    rows = [
        [name, len(one.members), *_cells(one), one.fix and one.fix.name, one.fix and one.fix.changed]
        for name, one in every
    ]
    return section("failures", about, Groups(shown), sheet("failures", rows))


def _cells(one: FailureGroup) -> list[Cell]:
    check = one.failure["check"]
    ground = [one.failure["class"], one.failure["kind"], check and plain_check(check)]
    return [one.task, *ground, one.why, name_of(one.representative)]


# --- verdicts under another suite, and under house rules


def other_suite_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section that compares verdicts under the report's suite with those under another suite."""
    judged = [(run, run.other_suite) for run in runs if run.other_suite is not None]
    found = [verdict_changes(run.name, run.results, other) for run, other in judged]
    here, there = ranks(found)
    scores: list[list[Cell]] = []
    tasks: list[list[Cell]] = []
    reversals: list[list[Cell]] = []
    for one in found:
        before, after = one.pass_at_1
        over, places = one.comparison.over_tasks, (here[one.name], there[one.name])
        scores.append([one.name, before, after, after - before, over.low, over.high, *places])
        for task in one.tasks:
            counts = task.both, task.first_only, task.second_only, task.neither
            tasks.append([task.task, one.name, *counts])
        sides = zip(one.suites, (one.first_only, one.second_only), strict=True)
        those = [(suite, group) for suite, groups in sides for group in groups]
        for suite, group in sorted(those, key=lambda pair: -len(pair[1].members)):
            reversals.append([one.name, f"{suite} only", len(group.members), *_cells(group)])
    sheets = sheet("beside", scores), sheet("beside-tasks", tasks), sheet("reversals", reversals)
    return section("beside", Prose(sentences(found)), *sheets)


def house_rules_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on house rules, for runs judged both with and without them."""
    rows: list[list[Cell]] = []
    by_rule: list[list[Cell]] = []
    notes = []
    for run in runs:
        if run.house is None:
            continue
        found = count_broken_rules(run.house.table, run.results.table)
        broken, cost = found.broken, found.cost
        assert cost is not None, "the run was also judged without rules"
        scores = overall(run.scores, 1).mean, overall(task_scores(run.house.table), 1).mean
        rows.append([run.name, broken.mean, broken.low, broken.high, *scores, cost.mean, cost.low, cost.high])
        by_rule += [[rule, run.name, count] for rule, count in found.by_rule.items()]
        notes += [
            f"{run.name}: the interval of the {what} is {estimate.ends()}."
            for what, estimate in (("share that breaks a rule", broken), ("difference", cost))
            if not estimate.is_known
        ]
    return section("house", sheet("house", rows, notes=notes), sheet("broken-rules", by_rule))
