"""Compares models on the same prompts: how much and how significantly they differ, and in which tasks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from typing import Any, TypeVar

import polars as pl

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible
from codebotler.core.text.words import counted
from codebotler.core.trace import Status
from roboeval.analysis.counting.counts import tally_of, task_scores
from roboeval.analysis.counting.summary import failures
from roboeval.analysis.metrics import DIFFERENCE, ROUNDING_ERROR, Estimate, by_formula, mean_of, pass_at_1
from roboeval.analysis.statistics import SampleSizes, by_bootstrap, p_by_signs, sample_sizes
from roboeval.evaluation.judging.failures import (
    AGENT_ERROR_CLASS,
    NO_PROGRAM_CLASS,
    PYTHON_ERROR_CLASS,
    ROBOT_ERROR_CLASS,
    TASK_ERROR_CLASS,
)
from roboeval.evaluation.runs.completions import how_many
from roboeval.evaluation.runs.results import Results

SIGNIFICANCE = 0.05
MIN_SHOWN_P = 0.001  # smaller values are shown as "p < 0.001"
MAX_PAIRS = 10  # if there are more pairs, each run is compared only with the best
PromptScores = Mapping[tuple[str, int], float]  # pass@1 by task and prompt
RunLike = TypeVar("RunLike")


@dataclass(frozen=True)
class TaskDifference:
    """The mean pass@1 of two models on one task, and the difference, second minus first."""

    task: str
    first: float  # mean pass@1 over common prompts
    second: float
    share: float  # contribution to the difference over all prompts
    prompts: int  # common prompts
    difference: Estimate  # second minus first, with its interval over prompts


@dataclass(frozen=True)
class Comparison:
    """The difference in pass@1 between two models, second minus first, over their common prompts."""

    first: float  # mean pass@1
    second: float
    prompts: int  # common prompts
    left_out: int  # number of prompts that only one model has
    over_prompts: Estimate  # the difference, with its interval over prompts
    over_tasks: Estimate  # the difference, with its interval over tasks
    bootstrap: Estimate  # the difference, with an interval from a cluster bootstrap over tasks
    p_prompts: float  # p-value of the sign-flip permutation test over prompts
    p_tasks: float  # p-value of the same test over tasks
    sample_sizes: SampleSizes
    tasks: tuple[TaskDifference, ...]  # sorted by contribution, largest first
    counts_missions: bool = False  # rather than completions; then no sample sizes are known


def compare_scores(first: PromptScores, second: PromptScores) -> Comparison:
    """Compare two models on their common prompts. Raise UserError if there are none."""
    keys = [key for key in first if key in second]
    if not keys:
        raise UserError("the runs have no prompt in common; compare runs with completions for the same tasks")
    by_task: dict[str, list[tuple[float, float]]] = defaultdict(list)
    for key in keys:
        by_task[key[0]].append((first[key], second[key]))
    pairs = [pair for pairs in by_task.values() for pair in pairs]
    tasks = [[b - a for a, b in pairs] for pairs in by_task.values()]
    prompts = [[b - a] for a, b in pairs]
    return Comparison(
        first=mean_of([[a for a, _ in pairs]]),
        second=mean_of([[b for _, b in pairs]]),
        prompts=len(pairs),
        left_out=len({*first, *second}) - len(keys),
        over_prompts=by_formula(prompts, within=DIFFERENCE),
        over_tasks=by_formula(tasks, within=DIFFERENCE, over="tasks"),
        bootstrap=by_bootstrap(tasks, within=DIFFERENCE, over="tasks"),
        p_prompts=p_by_signs(prompts),
        p_tasks=p_by_signs(tasks),
        sample_sizes=sample_sizes(pairs),
        tasks=tuple(sorted(_by_task(by_task), key=lambda one: (-abs(one.share), one.task))),
    )


# --- missions: a program in a world counts as one, like a mission of an agent


def has_missions(table: pl.DataFrame) -> bool:
    """Return whether any completion in a table is an agent's mission, which takes place in a single world."""
    return table["ending"].null_count() < table.height


def per_mission(table: pl.DataFrame) -> pl.DataFrame:
    """Return a copy of a run's table in which each row counts as a completion of its own.

    A row is one completion in one world. This makes programs comparable with agents' missions.
    """
    kept = pl.col("failure_class").is_in([NO_PROGRAM_CLASS, AGENT_ERROR_CLASS])
    is_check = pl.col("failed_checks").is_not_null()
    is_robots = pl.col("status") == Status.ROBOT_ERROR.value
    of_check = pl.when(is_check).then(pl.lit(TASK_ERROR_CLASS))
    of_world = of_check.when(is_robots).then(pl.lit(ROBOT_ERROR_CLASS)).otherwise(pl.lit(PYTHON_ERROR_CLASS))
    kind = pl.when(is_check).then("category").otherwise("error_kind")
    failed = pl.when(~pl.col("satisfied"))
    return table.with_columns(
        passed=pl.col("satisfied"),
        world_number=pl.lit(0),
        failure_class=failed.then(pl.when(kept).then("failure_class").otherwise(of_world)),
        failure_kind=failed.then(pl.when(kept).then("failure_kind").otherwise(kind)),
    )


def comparable_tables(*tables: pl.DataFrame) -> Sequence[pl.DataFrame]:
    """Return the tables, with `per_mission` applied to all of them if any contains an agent's missions."""
    return [*map(per_mission, tables)] if any(map(has_missions, tables)) else tables


def compare_tables(first: pl.DataFrame, second: pl.DataFrame) -> Comparison:
    """Compare two runs on their common prompts, using `per_mission` tables if either contains missions."""
    found = compare_scores(*(pass_at_1(task_scores(table)) for table in comparable_tables(first, second)))
    if not (has_missions(first) or has_missions(second)):
        return found
    return replace(found, sample_sizes=SampleSizes(None, None), counts_missions=True)


def _by_task(by_task: Mapping[str, Sequence[tuple[float, float]]]) -> Iterator[TaskDifference]:
    total = sum(map(len, by_task.values()))
    for task, pairs in by_task.items():
        n = len(pairs)
        first, second = mean_of([[a for a, _ in pairs]]), mean_of([[b for _, b in pairs]])
        difference = by_formula([[b - a] for a, b in pairs], within=DIFFERENCE)
        yield TaskDifference(task, first, second, (second - first) * n / total, n, difference)


def pairs_to_compare(
    runs: Sequence[RunLike], pass_at_1: Callable[[RunLike], float]
) -> list[tuple[RunLike, RunLike]]:
    """Return all pairs of runs. If these are more than 10, only pair each run with the best one by pass@1."""
    pairs = list(combinations(runs, 2))
    if len(pairs) <= MAX_PAIRS:
        return pairs
    best = max(runs, key=pass_at_1)
    return [(run, best) for run in runs if run is not best]


def p_text(p: float) -> str:
    """Format a p-value, such as "p = 0.042" or "p < 0.001"."""
    return f"p = {p:.3f}" if p >= MIN_SHOWN_P else f"p < {MIN_SHOWN_P}"


def comparison_sentence(comparison: Comparison, names: tuple[str, str]) -> str:
    """Say which of the two named runs is better, with the p-value, and how many prompts were left out."""
    sentence = _better_sentence(comparison, names)
    if not comparison.left_out:
        return sentence
    left = counted(comparison.left_out, "prompt")
    both = counted(comparison.prompts, "prompt")
    return f"{sentence} Based on {both} in common, without {left} that only one run has."


def _better_sentence(comparison: Comparison, names: tuple[str, str]) -> str:
    difference = comparison.over_tasks.mean
    if abs(difference) < ROUNDING_ERROR:
        return f"{names[0]} and {names[1]} pass equally often."
    better, other = (names[1], names[0]) if difference > 0 else names
    by = f"{100 * abs(difference):.1f} points"
    if comparison.p_tasks <= SIGNIFICANCE:
        return f"{better} is better than {other} by {by} ({p_text(comparison.p_tasks)} over tasks)."
    if comparison.p_prompts <= SIGNIFICANCE:
        p = f"{p_text(comparison.p_prompts)} over prompts"
        few = f"{counted(len(comparison.tasks), 'task')} are too few to generalise to others"
        return f"{better} is better than {other} by {by} on prompts like these ({p}); {few}."
    p = f"{p_text(comparison.p_tasks)} over tasks"
    return f"{better} passes more often than {other} by {by}, but the difference is not significant ({p})."


MISSIONS_COMPARED = "each program or agent in each world counts as one mission"


def other_differences(first: Results, second: Results) -> list[str]:
    """Describe differences between two runs' settings, such as "temperature differs: 0.2 and 1.0"."""
    runs, found = (first, second), []
    modes = [run.about.get("mode", "program") for run in runs]
    if modes[0] != modes[1]:
        found.append(f"the modes differ: {modes[0]} and {modes[1]}; {MISSIONS_COMPARED}")
    compared = {
        "Python for judging": [run.manifest.get("python") for run in runs],
        "codebotler for judging": [run.manifest.get("codebotler") for run in runs],
        "prompt template": [run.about.get("template") if modes[0] == modes[1] else None for run in runs],
    }
    compared = {name: both for name, both in compared.items() if None not in both}
    settings = [value if isinstance(value := run.about.get("settings"), dict) else {} for run in runs]
    if all(settings):
        names = sorted({*settings[0], *settings[1]})
        compared |= {name.replace("_", "-"): [one.get(name) for one in settings] for name in names}
    elif any(settings):
        found.append("the settings of one run were not recorded")
    differing = ((name, *both) for name, both in compared.items() if both[0] != both[1])
    return found + [f"{name} differs: {_short(a)} and {_short(b)}" for name, a, b in differing]


def _short(value: object) -> str:
    return "none" if value is None else visible(str(value))[:12]


def failure_shares(table: pl.DataFrame) -> dict[str, float]:
    """Return the share of judged completions that fail with each class of failure, by name."""
    return {one.name: one.share for one in failures(tally_of(table))}


def comparison_data(comparison: Comparison, names: tuple[str, str]) -> dict[str, Any]:
    """Convert a comparison to JSON data, for `roboeval compare --json`."""
    return {
        "first": {"name": names[0], "pass@1": comparison.first},
        "second": {"name": names[1], "pass@1": comparison.second},
        "counts": "missions" if comparison.counts_missions else "completions",
        "prompts": comparison.prompts,
        "prompts_left_out": comparison.left_out,
        "difference": comparison.over_tasks.mean,
        "interval": {
            "prompts": _ends(comparison.over_prompts),
            "tasks": _ends(comparison.over_tasks),
            "bootstrap": _ends(comparison.bootstrap),
        },
        "p": {"prompts": comparison.p_prompts, "tasks": comparison.p_tasks},
        "needed": asdict(comparison.sample_sizes),
        "tasks": [{**asdict(task), "difference": task.second - task.first} for task in comparison.tasks],
    }


def _ends(estimate: Estimate) -> dict[str, float]:
    return {"low": estimate.low, "high": estimate.high}


def sample_size_sentences(comparison: Comparison) -> list[str]:
    """Say how many completions or prompts would detect the difference. Return [] for agents' missions."""
    sizes = comparison.sample_sizes
    if comparison.counts_missions:
        return []
    if sizes.completions is None:
        return ["There is no difference, so no sample size can be computed."]
    each = how_many(sizes.completions)
    total = f"{sizes.completions * comparison.prompts:,} in all for each model"
    needed = [f"For 80% power on these prompts, use {each} per prompt and model ({total})."]
    if sizes.prompts is not None:
        needed.append(f"For 80% power on prompts like these, use {sizes.prompts:,} prompts.")
    return needed
