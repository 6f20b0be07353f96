"""How often programs do what was asked: by model, by task and by prompt, and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.analysis.resample import ROUNDING
from roboeval.analysis.statistics import FEW, by_bootstrap, by_formula
from roboeval.report import paper
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Cell, Column, Sheet, sheet
from roboeval.suites.load import Suite

INTERVALS = (
    "pass@1 is the mean over all prompts of the share of completions that pass. Of 100 intervals made like "
    "these, from prompts or tasks drawn anew each time, 95 hold the true mean. For the first pair of ends, "
    "prompts are taken as drawn at random, for the others tasks are: a formula (Student's t over clusters) "
    "and a bootstrap that draws whole tasks again, 10,000 times, with seed 0. Quote those over tasks where "
    "you speak of tasks that are not in the suite: prompts of a task resemble each other."
)
BY_TASK = (
    "The mean pass@1 over the prompts of a task, and the prompts that did worst and best. The bars and error "
    "bars of the first figure."
)
BY_PROMPT = "The share of completions that pass, for each prompt, which are counted from 0."
CURVE = (
    "The share of prompts whose pass@1 is at least the threshold; the last row is the share of prompts with "
    "any completion that passes."
)


def overall_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """pass@1 of each run, with intervals."""
    columns = (
        Column("model"),
        Column("completions", "count"),
        Column("prompts", "count"),
        Column("tasks", "count"),
        Column("pass@1", "share"),
        Column("prompts: low", "share"),
        Column("prompts: high", "share"),
        Column("tasks: low", "share"),
        Column("tasks: high", "share"),
        Column("bootstrap: low", "share"),
        Column("bootstrap: high", "share"),
    )
    return sheet(
        "overall",
        "How often programs pass, and how sure that is",
        columns,
        [_overall_row(run) for run in runs],
        about=INTERVALS,
        notes=[*_few_tasks(runs), *_unfinished(runs)],
    )


def _overall_row(run: JudgedRun) -> list[str | int | float]:
    tasks = list(run.by_task.values())
    prompts = [[value] for values in tasks for value in values]
    ends = [by_formula(prompts), by_formula(tasks), by_bootstrap(tasks)]
    mean = ends[0].mean
    flat = [end for estimate in ends for end in (estimate.low, estimate.high)]
    return [run.name, run.completions.height, len(prompts), len(tasks), mean, *flat]


def _few_tasks(runs: Sequence[JudgedRun]) -> list[str]:
    few = [run.name for run in runs if len(run.by_task) < FEW]
    if not few:
        return []
    of_which = "" if len(few) == len(runs) else f" of {', '.join(few)}"
    few_tasks = f"The bootstrap{of_which} draws from fewer than {FEW} tasks, for which it is too narrow"
    return [f"{few_tasks}; quote the formula."]


def _unfinished(runs: Sequence[JudgedRun]) -> list[str]:
    counts = [(run.name, run.completions.height, run.results.scope.total) for run in runs]
    return [
        f"{name}: only {count:,} of {total:,} completions are judged, and only these count."
        for name, count, total in counts
        if count < total
    ]


def tasks_of(runs: Sequence[JudgedRun], suite: Suite) -> list[str]:
    """The tasks for which some run has completions, in the order of the suite."""
    there = {task for run in runs for task in run.by_task}
    return [task for task in dict.fromkeys([*suite.tasks, *sorted(there)]) if task in there]


def task_sheet(runs: Sequence[JudgedRun], suite: Suite) -> Sheet:
    """pass@1 by task, with the published means of the paper's models."""
    columns = [
        Column("task"),
        Column("model"),
        Column("requirements"),
        Column("pass@1", "share"),
        Column("worst prompt", "share"),
        Column("best prompt", "share"),
    ]
    rows: list[list[Cell]] = [
        [score.task, run.name, what, score.pass_at(1).mean, score.lowest(1), score.highest(1)]
        for what, ablated in (("all", False), ("common sense only", True))
        for task in tasks_of(runs, suite)
        for run in runs
        for score in (run.ablated_scores if ablated else run.scores)
        if score.task == task
    ]
    return sheet("tasks", "pass@1 by task", columns, rows, about=BY_TASK, notes=_without_ablation(runs))


def _without_ablation(runs: Sequence[JudgedRun]) -> list[str]:
    names = [run.name for run in runs if run.ablated is None]
    if not names:
        return []
    some = "No run" if len(names) == len(runs) else f"Not {', '.join(names)}:"
    return [f"{some} was judged with --ablation, which requires common sense only."]


def prompt_sheet(runs: Sequence[JudgedRun], suite: Suite) -> Sheet:
    """pass@1 by task and prompt, with the published cell where it was written for the same prompt."""
    columns = [Column("task"), Column("prompt", "count")]
    beside = []
    for run in runs:
        model = paper.model_of(run)
        beside.append(model if model and paper.is_of_authors_prompts(run, suite) else None)
        columns.append(Column(run.name, "share"))
        columns += [Column(f"{run.name}, published", "share")] if beside[-1] else []
    cells = [run.by_prompt for run in runs]
    order = tasks_of(runs, suite)
    keys = sorted({key for run in cells for key in run}, key=lambda key: (order.index(key[0]), key[1]))
    rows = []
    for key in keys:
        row: list[str | int | float | None] = [*key]
        for ours, model in zip(cells, beside, strict=True):
            row.append(ours.get(key))
            row += [paper.cell(model, *key) if key in ours else None] if model else []
        rows.append(row)
    notes = [paper.OWN_PROMPTS] if any(beside) else []
    return sheet("prompts", "pass@1 by task, prompt and model", columns, rows, about=BY_PROMPT, notes=notes)


def published_sheet(runs: Sequence[JudgedRun], suite: Suite) -> Sheet | None:
    """Means of tasks beside the published ones; None if no run names a model of the paper."""
    known = [(run, model) for run in runs if (model := paper.model_of(run)) is not None]
    if not known:
        return None
    columns = [
        Column("task"),
        Column("model"),
        Column("here", "share"),
        Column("published", "share"),
        Column("difference", "difference"),
    ]
    rows: list[list[str | float | None]] = []
    for run, model in known:
        means = {score.task: score.pass_at(1).mean for score in run.scores}
        pairs = [(task, mean, paper.task_mean(model, task)) for task, mean in means.items()]
        values = [value for values in run.by_task.values() for value in values]
        pairs.append(("all of these", sum(values) / len(values), paper.overall_mean(model, list(means))))
        rows += [
            [task, run.name, ours, theirs, None if theirs is None else ours - theirs]
            for task, ours, theirs in pairs
        ]
    notes = [*paper.taken_for(runs), paper.TWO_SUMS]
    if not all(paper.is_of_authors_prompts(run, suite) for run, _ in known):
        notes.insert(1, paper.OTHER_PHRASINGS)
    return sheet(
        "published",
        "Beside what the paper's authors published",
        columns,
        rows,
        about="The mean pass@1 over the prompts of a task, here and as published.",
        notes=notes,
    )


def share_at_least(values: Sequence[float], threshold: float) -> float:
    """The share of values that reach a threshold."""
    return sum(value >= threshold - ROUNDING for value in values) / len(values)


def curve(values: Sequence[float]) -> list[tuple[float, float]]:
    """The share of prompts that reach each threshold at which it changes, from 1 down to above 0."""
    thresholds = sorted({1.0, *(value for value in values if value > ROUNDING)}, reverse=True)
    return [(threshold, share_at_least(values, threshold)) for threshold in thresholds]


def curve_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """The second figure as numbers."""
    curves = {run.name: [*run.by_prompt.values()] for run in runs}
    thresholds = sorted({t for values in curves.values() for t, _ in curve(values)}, reverse=True)
    rows = [[t, *(share_at_least(values, t) for values in curves.values())] for t in thresholds]
    columns = [Column("threshold", "share"), *(Column(name, "share") for name in curves)]
    return sheet("curve", "Prompts by threshold of pass@1", columns, rows, about=CURVE)
