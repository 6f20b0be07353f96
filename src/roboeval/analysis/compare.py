"""Is one model better than another? Differences paired by prompt, how sure they are, and where they arise."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any, TypeVar

from codebotler.core.errors import UserError
from codebotler.core.terminal import visible
from codebotler.core.words import counted
from roboeval.analysis.counts import tally_of
from roboeval.analysis.metrics import DIFFERENCE, Estimate, by_formula, mean_of
from roboeval.analysis.statistics import (
    ROUNDING,
    Needed,
    by_bootstrap,
    needed,
    p_by_signs,
)
from roboeval.analysis.summary import cut_off, failures
from roboeval.evaluation.runs.completions import how_many
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.scope import Coverage, CutOff

LEVEL = 0.05  # a larger p may well be chance
SMALLEST_P = 0.001  # that is shown with its digits
MOST_PAIRS = 10  # beyond which each run is compared with the best only
PromptScores = Mapping[tuple[str, int], float]  # pass@1 by task and prompt
RunLike = TypeVar("RunLike")


@dataclass(frozen=True)
class TaskDifference:
    """How two models differ in one task."""

    task: str
    first: float  # mean pass@1 over the prompts that both have
    second: float
    share: float  # of the difference over all prompts
    prompts: int  # that both have

    @property
    def difference(self) -> float:
        """By how much the second is better."""
        return self.second - self.first


@dataclass(frozen=True)
class Comparison:
    """How two models differ, the second minus the first, over the prompts that both have."""

    first: float  # mean pass@1
    second: float
    prompts: int  # that both have
    left_out: int  # prompts that only one has
    over_prompts: Estimate  # the difference, with prompts drawn at random
    over_tasks: Estimate  # with tasks drawn at random
    bootstrap: Estimate  # the same by drawing tasks again
    p_prompts: float  # how often signs drawn for each prompt give a difference as large
    p_tasks: float  # the same with one sign for each task
    needed: Needed
    tasks: tuple[TaskDifference, ...]  # those that made the difference first


def compared(first: PromptScores, second: PromptScores) -> Comparison:
    """Compare two models prompt by prompt; raises UserError if they have none in common."""
    keys = [key for key in first if key in second]
    if not keys:
        raise UserError("the runs have no prompt in common, so they cannot be compared")
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
        needed=needed(pairs),
        tasks=tuple(sorted(_by_task(by_task), key=lambda one: (-abs(one.share), one.task))),
    )


def _by_task(by_task: Mapping[str, Sequence[tuple[float, float]]]) -> Iterator[TaskDifference]:
    total = sum(map(len, by_task.values()))
    for task, pairs in by_task.items():
        n = len(pairs)
        first, second = mean_of([[a for a, _ in pairs]]), mean_of([[b for _, b in pairs]])
        yield TaskDifference(task, first, second, (second - first) * n / total, n)


def pairs_to_compare(
    runs: Sequence[RunLike], pass_at_1: Callable[[RunLike], float]
) -> list[tuple[RunLike, RunLike]]:
    """All pairs of runs; of many runs, each with the best."""
    pairs = list(combinations(runs, 2))
    if len(pairs) <= MOST_PAIRS:
        return pairs
    best = max(runs, key=pass_at_1)
    return [(run, best) for run in runs if run is not best]


def p_text(p: float) -> str:
    """A p for people."""
    return f"p = {p:.3f}" if p >= SMALLEST_P else f"p < {SMALLEST_P}"


def verdict(comparison: Comparison, names: tuple[str, str]) -> str:
    """Which is better, as far as the prompts of both can tell, and how many prompts were left out."""
    sentence = _better(comparison, names)
    if not comparison.left_out:
        return sentence
    left = counted(comparison.left_out, "prompt")
    both = counted(comparison.prompts, "prompt")
    return f"{sentence} Compared on the {both} that both have; {left} that only one has are left out."


def _better(comparison: Comparison, names: tuple[str, str]) -> str:
    difference = comparison.over_tasks.mean
    if abs(difference) < ROUNDING:
        return f"{names[0]} and {names[1]} pass equally often."
    better, other = (names[1], names[0]) if difference > 0 else names
    by = f"{100 * abs(difference):.1f} points"
    if comparison.p_tasks <= LEVEL:
        return f"{better} is better than {other} by {by} ({p_text(comparison.p_tasks)} over tasks)."
    if comparison.p_prompts <= LEVEL:
        tasks = counted(len(comparison.tasks), "task")
        p_value = f"{p_text(comparison.p_prompts)} over prompts"
        return (
            f"{better} is better than {other} by {by} on prompts like these ({p_value}); "
            f"{tasks} cannot speak for others."
        )
    p_value = f"{p_text(comparison.p_tasks)} over tasks"
    return f"{better} passes more often than {other} by {by}, which may well be chance ({p_value})."


def unlike(first: Results, second: Results) -> list[str]:
    """What differs between two runs, other than the model, and may explain a difference."""
    judged_with = ("python", "codebotler")  # of generation, run.json has these as well
    runs = [{**one.about, **{name: one.head.get(name) for name in judged_with}} for one in (first, second)]
    differences = []
    for name, words in WORDS.items():
        a, b = (run.get(name) for run in runs)
        if a is not None and b is not None and a != b:
            differences.append(f"{words} differ: {_said(a)} and {_said(b)}")
    settings = [found if isinstance(found := run.get("settings"), dict) else {} for run in runs]
    if bool(settings[0]) != bool(settings[1]):
        differences.append("the settings of one of them were not recorded")
    for name in sorted({*settings[0], *settings[1]} if all(settings) else ()):
        a, b = (one.get(name) for one in settings)
        if a != b:
            differences.append(f"{name.replace('_', '-')} differs: {_said(a)} and {_said(b)}")
    return differences


WORDS = {
    "python": "the Python versions with which they were judged",
    "codebotler": "the versions of codebotler with which they were judged",
    "template": "the prompt templates",
}


def _said(value: object) -> str:
    return "none" if value is None else visible(str(value))[:12]


@dataclass(frozen=True)
class Compared:
    """One of two runs that are compared."""

    name: str
    coverage: Coverage
    cut_off: CutOff
    classes: Mapping[str, float]  # of failures, in shares of all judged completions

    @classmethod
    def of(cls, name: str, results: Results) -> Compared:
        """What a comparison says of a run besides pass@1."""
        tally = tally_of(results.table)
        found = failures(tally)
        shares = {one.name: one.share for one in found}
        scope = results.scope
        return cls(name, scope.coverage(tally.judged.total()), cut_off(found, scope), shares)

    @property
    def data(self) -> dict[str, Any]:
        """It as plain data, without its name."""
        return {
            **asdict(self.coverage),
            "cut_off": self.cut_off.replies,
            "failures": dict(self.classes),
        }


def comparison_data(comparison: Comparison, names: tuple[str, str]) -> dict[str, Any]:
    """A comparison as plain data."""
    return {
        "first": {"name": names[0], "pass@1": comparison.first},
        "second": {"name": names[1], "pass@1": comparison.second},
        "prompts": comparison.prompts,
        "prompts_left_out": comparison.left_out,
        "difference": comparison.over_tasks.mean,
        "interval": {
            "prompts": _ends(comparison.over_prompts),
            "tasks": _ends(comparison.over_tasks),
            "bootstrap": _ends(comparison.bootstrap),
        },
        "p": {"prompts": comparison.p_prompts, "tasks": comparison.p_tasks},
        "needed": asdict(comparison.needed),
        "tasks": [{**asdict(task), "difference": task.difference} for task in comparison.tasks],
    }


def _ends(estimate: Estimate) -> dict[str, float]:
    return {"low": estimate.low, "high": estimate.high}


def to_tell(comparison: Comparison) -> list[str]:
    """The sample sizes with which the two would be told apart, in sentences."""
    much = comparison.needed
    if much.completions is None:
        return ["There is no difference, so no sample size can be computed."]
    each = how_many(much.completions)
    total = much.completions * comparison.prompts
    needed = [
        f"For 80% power on these prompts, use {each} per prompt and model ({total:,} in all for each model)."
    ]
    if much.prompts is not None:
        needed.append(f"For 80% power on prompts like these, use {much.prompts:,} prompts.")
    return needed
