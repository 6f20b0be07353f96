"""Builds the sections on pass@1 by model, by task and by prompt."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

from codebotler.core.errors import UserError
from roboeval.analysis.comparisons.compare import (
    MAX_PAIRS,
    compare_tables,
    comparison_sentence,
    has_missions,
    other_differences,
    pairs_to_compare,
)
from roboeval.analysis.metrics import (
    TaskScore,
    by_formula,
    overall,
    prompts_of,
    share_at_least,
    threshold_curve,
)
from roboeval.analysis.statistics import by_bootstrap
from roboeval.report import paper
from roboeval.report.figures import bars as figures
from roboeval.report.figures.curves import draw_thresholds
from roboeval.report.runs import JudgedRun, coverage_of, runs_to_draw, tasks_of
from roboeval.report.sheets import Cell, Prose, ReportFigure, Section, Sheet, note, section, sheet


def results_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on pass@1 by run and task."""
    coverage = coverage_of(runs)
    by_run = ReportFigure("overall", lambda: figures.draw_overall(runs), coverage)
    drawn, left_out = runs_to_draw(runs)
    by_task = ReportFigure("tasks", lambda: figures.draw_task_scores(drawn), [*coverage, *left_out])
    return section("results", by_run, overall_sheet(runs), by_task, task_sheet(runs))


def overall_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of pass@1 by run, with intervals."""
    rows: list[list[Cell]] = []
    for run in runs:
        tasks = [[prompt.pass_at(1) for prompt in score.prompts] for score in run.scores]
        over_prompts = by_formula([[prompt.pass_at(1)] for prompt in prompts_of(run.scores)])
        found = [overall(run.scores, 1), over_prompts, by_bootstrap(tasks, over="tasks")]
        ends = [end for estimate in found for end in (estimate.low, estimate.high)]
        coverage = run.results.coverage
        counts = coverage.judged, coverage.total, len(run.by_prompt), len(tasks)
        rows.append([run.name, *counts, found[0].mean, *ends])
    missions = [note("missions")] if any(has_missions(run.table) for run in runs) else []
    return sheet("overall", rows, notes=missions)


def task_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of pass@1 by task and run."""
    rows: list[list[Cell]] = [
        _task_row(run, score, what)
        for what, is_ablated in (("all", False), ("common sense only", True))
        for task in tasks_of(runs)
        for run in runs
        for score in (run.ablated_scores if is_ablated else run.scores)
        if score.task == task
    ]
    without = [run.name for run in runs if run.ablated is None]
    which = "any run" if len(without) == len(runs) else ", ".join(without)
    missing = f"Common-sense results are missing for {which}; judge with `roboeval evaluate --ablation`."
    return sheet("tasks", rows, notes=[missing] if without else [])


def _task_row(run: JudgedRun, score: TaskScore, what: str) -> list[Cell]:
    passed, coverage = score.pass_at(1), run.results.scope.coverage(score.completions, score.task)
    ends = (passed.low, passed.high) if passed.is_known else (None, None)
    counts = coverage.judged, coverage.total
    return [score.task, run.name, what, *counts, passed.mean, *ends, score.lowest(1), score.highest(1)]


def thresholds_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on how many prompts have a pass@1 of at least x, for each x (paper, section V.A)."""
    drawn, left_out = runs_to_draw(runs)
    figure = ReportFigure("thresholds", lambda: draw_thresholds(drawn), left_out)
    return section("thresholds", figure, curve_sheet(runs))


def curve_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of the share of prompts with a pass@1 of at least x, for each x and run."""
    curves = [[*run.by_prompt.values()] for run in runs]
    steps = sorted({t for values in curves for t, _ in threshold_curve(values)}, reverse=True)
    rows = [[t, *(share_at_least(values, t) for values in curves)] for t in steps]
    return sheet("curve", rows, shares=[run.name for run in runs])


def differences_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section that compares runs in pairs or, with more than 10 pairs, each run with the best."""
    rows: list[list[Cell]] = []
    sentences: list[str] = []
    notes: list[str] = []
    for first, second in pairs_to_compare(runs, lambda run: run.mean):
        try:
            found = compare_tables(first.table, second.table)
        except UserError:  # no prompt in common
            continue
        if len(sentences) < MAX_PAIRS:
            sentences.append(comparison_sentence(found, (first.name, second.name)))
            pair, over_prompts = f"{first.name} and {second.name}", found.over_prompts
            if not over_prompts.is_known:
                notes.append(f"{pair}: the interval over prompts is {over_prompts.ends()}.")
            if others := other_differences(first.results, second.results):
                notes.append(f"{pair}: {'; '.join(others)}.")
        over = found.over_prompts, found.over_tasks
        ends = [end for estimate in over for end in (estimate.low, estimate.high)]
        ps = found.p_prompts, found.p_tasks
        sizes = found.sample_sizes.completions, found.sample_sizes.prompts
        rows.append([f"{second.name} minus {first.name}", found.prompts, over[0].mean, *ends, *ps, *sizes])
    notes = [*([note("many-pairs")] if len(rows) > 1 else []), *notes]
    return section("differences", Prose(sentences), sheet("differences", rows, notes=notes))


def leader_sentences(runs: Sequence[JudgedRun]) -> list[str]:
    """Compare the two best runs in one sentence. Return [] if they cannot be compared."""
    if len(runs) == 1:
        return []
    best, second, *_ = sorted(runs, key=lambda run: -run.mean)
    try:
        return [comparison_sentence(compare_tables(second.table, best.table), (second.name, best.name))]
    except UserError:  # no prompt in common
        return []


def prompt_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of pass@1 by task and prompt, with the published values of the paper's prompts."""
    imported = [run for run in runs if paper.uses_authors_prompts(run)]
    theirs = {run.name: model for run in imported if (model := paper.model_of(run)) is not None}
    heads = [[run.name, *([f"{run.name}, published"] if run.name in theirs else [])] for run in runs]
    order = {task: at for at, task in enumerate(tasks_of(runs))}
    keys = sorted({key for run in runs for key in run.by_prompt}, key=lambda key: (order[key[0]], key[1]))
    rows = [[*key, *_cells(runs, theirs, key)] for key in keys]
    return sheet("prompts", rows, notes=[note("own-prompts")] if theirs else [], shares=[*chain(*heads)])


def _cells(runs: Sequence[JudgedRun], theirs: Mapping[str, str], key: tuple[str, int]) -> Iterator[Cell]:
    for run in runs:
        yield run.by_prompt.get(key)
        if run.name in theirs:
            yield paper.cell(theirs[run.name], *key) if key in run.by_prompt else None
