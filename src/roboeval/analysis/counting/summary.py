"""Summarises an evaluation: pass rates, and counts of failures by class and kind."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from codebotler.core.errors import UserError
from roboeval.analysis.counting.counts import Tally, scores_of
from roboeval.analysis.metrics import Estimate, PromptScore, TaskScore, overall, prompts_of
from roboeval.evaluation.judging.failures import AGENT_ERROR_CLASS, FAILURE_CLASSES
from roboeval.evaluation.runs.completions import how_many
from roboeval.evaluation.runs.scope import Coverage, JudgingScope
from roboeval.suites.load import Suite


@dataclass(frozen=True)
class Failures:
    """The number of failures of a class or of a kind, and their share of all judged completions."""

    name: str
    count: int
    share: float  # of all judged completions
    kinds: tuple[Failures, ...] = ()  # kinds of a class; known kinds come first, even if they did not occur


@dataclass(frozen=True)
class EvaluationSummary:
    """The results of an evaluation: scores, failures and coverage."""

    k: tuple[int, ...]
    tasks: tuple[TaskScore, ...]  # tasks with completions, in the order of the suite
    overall: tuple[Estimate, ...]  # pass@k for each value of k
    failures: tuple[Failures, ...]
    scope: JudgingScope
    missing: tuple[str, ...]  # tasks of the suite without a score
    ablated: bool = False  # judged by common-sense requirements only

    @property
    def prompts(self) -> list[PromptScore]:
        """The scores of all prompts, across tasks."""
        return prompts_of(self.tasks)

    @property
    def judged(self) -> int:
        """The number of judged completions."""
        return sum(task.completions for task in self.tasks)

    @property
    def coverage(self) -> Coverage:
        """The numbers of judged, existing and requested completions of the selected tasks."""
        return self.scope.coverage(self.judged)


def summarise(
    tally: Tally, suite: Suite, scope: JudgingScope, *, k: Sequence[int] = (1,), ablated: bool = False
) -> EvaluationSummary:
    """Summarise an evaluation, with pass@k for each k. Raise UserError if it is empty or k is too large."""
    tasks = scores_of(tally, suite.tasks)
    if not tasks:
        raise UserError(f"0 of {how_many(scope.total)} are judged; run `roboeval evaluate`")
    try:
        estimates = tuple(overall(tasks, tries) for tries in k)
    except ValueError as error:
        fewest = min(prompt.completions for prompt in prompts_of(tasks))
        raise UserError(f"{error}; choose k from 1 to {fewest}") from None
    scored = {score.task for score in tasks}
    expected = [n for n, task in suite.tasks.items() if task.ablation is not None or not ablated]
    missing = tuple(name for name in expected if name not in scored)
    return EvaluationSummary(tuple(k), tasks, estimates, failures(tally), scope, missing, ablated)


def failures(tally: Tally) -> tuple[Failures, ...]:
    """Count failures by class and kind (paper, section V.B). At least one completion must be judged."""
    failed: dict[str, Counter[str]] = defaultdict(Counter)
    for (*_, name, kind), count in tally.items():
        if name is not None:
            failed[name][str(kind)] += count
    n = tally.total()

    def of_class(name: str) -> Failures:
        counts = failed.get(name, Counter())
        known = FAILURE_CLASSES[name].kinds if name in FAILURE_CLASSES else ()
        others = sorted(counts.keys() - set(known), key=lambda kind: (-counts[kind], kind))
        kinds = tuple(Failures(kind, counts[kind], counts[kind] / n) for kind in [*known, *others])
        return Failures(name, counts.total(), counts.total() / n, kinds)

    usual = [name for name in FAILURE_CLASSES if name != AGENT_ERROR_CLASS or name in failed]
    return tuple(of_class(name) for name in [*usual, *sorted(failed.keys() - set(FAILURE_CLASSES))])


PASSED, ALL = "passed", "all"


@dataclass(frozen=True)
class Causes:
    """The shares of completions by outcome (passed or a failure class), and of kinds within each class."""

    classes: Mapping[str, float]  # shares of all completions, including PASSED
    kinds: Mapping[str, Mapping[str, float]]  # shares of the failures in a class
    counts: Mapping[tuple[str, str], int]  # by class and kind (ALL: the whole class); empty if unknown


def causes(tally: Tally) -> Causes:
    """Compute the share of each outcome (paper, section V.B). At least one completion must be judged."""
    found, passed = failures(tally), sum(n for (_, _, has_passed, *_), n in tally.items() if has_passed)
    kinds = {one.name: sorted((k.name, k.count) for k in one.kinds if k.count) for one in found}
    return Causes(
        {PASSED: passed / tally.total(), **{one.name: one.share for one in found}},
        {one.name: {kind: count / one.count for kind, count in kinds[one.name]} for one in found},
        {(PASSED, ALL): passed}
        | {(one.name, kind): n for one in found for kind, n in [(ALL, one.count), *kinds[one.name]]},
    )


def kinds_in_order(found: Iterable[Causes], name: str) -> list[str]:
    """Return the kinds of failure of class `name` that occur in any of `found`. Known kinds come first."""
    occurring = {kind for one in found for kind in one.kinds.get(name, {})}
    known = [kind for kind in FAILURE_CLASSES[name].kinds if kind in occurring]
    return [*known, *sorted(occurring - {*known})]


def summary_data(summary: EvaluationSummary) -> dict[str, Any]:
    """Convert a summary to JSON data, for `roboeval show --json`."""
    return {
        "models": sorted(model for model in summary.scope.models if model is not None),
        "judged": summary.judged,
        "to_judge": summary.scope.total,
        "requested": summary.coverage.requested,
        "cut_off": summary.scope.cut_off,
        "max_tokens": summary.scope.limit,
        **({"endings": dict(ends), "turns": summary.scope.turns} if (ends := summary.scope.endings) else {}),
        "completions": summary.judged,
        "passed": sum(task.passed for task in summary.tasks),
        **{f"pass@{k}": asdict(estimate) for k, estimate in zip(summary.k, summary.overall, strict=True)},
        "tasks": [_task_score_data(task, summary) for task in summary.tasks],
        "failures": [
            {**_failure_data(each, "class"), "kinds": [_failure_data(kind, "kind") for kind in each.kinds]}
            for each in summary.failures
        ],
        "missing": summary.missing,
    }


def _task_score_data(task: TaskScore, summary: EvaluationSummary) -> dict[str, Any]:
    ks = summary.k
    spreads = {
        f"pass@{k}": {"mean": task.pass_at(k).mean, "lowest": task.lowest(k), "highest": task.highest(k)}
        for k in ks
    }
    prompts = [
        {"prompt": prompt.prompt, **_counts(prompt), **{f"pass@{k}": prompt.pass_at(k) for k in ks}}
        for prompt in task.prompts
    ]
    requested = summary.scope.coverage(task.completions, task.task).requested
    return {"task": task.task, **_counts(task), "requested": requested, **spreads, "prompts": prompts}


def _counts(score: TaskScore | PromptScore) -> dict[str, int]:
    return {"completions": score.completions, "passed": score.passed}


def _failure_data(failures: Failures, what: str) -> dict[str, Any]:
    return {what: failures.name, "count": failures.count, "share": failures.share}
