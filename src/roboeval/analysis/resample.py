"""Computes the pass rate if programs that the check rejects are requested again (paper, section VI).

This rejection sampling draws completions of a prompt with replacement until one of them is accepted or the
limit on retries is reached. If all completions of a run were checked and judged, the result is exact.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import polars as pl

from roboeval.analysis.metrics import Estimate, mean_of, over_tasks, share_at_least
from roboeval.evaluation.runs.completions import KEY

LIMITS = (0, 2, 4, 8, 100)
THRESHOLDS = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class CheckedCompletion:
    """The results of checking and judging a completion."""

    accepted: bool  # whether the check found no problem
    ran: bool  # whether it ran without an error in every world of its task
    passed: bool


@dataclass(frozen=True)
class Chances:
    """The probabilities that the final program of a prompt is accepted, runs without error, and passes."""

    accepted: float
    ran: float
    passed: float


def final_chances(trials: Sequence[CheckedCompletion], retries: int) -> Chances:
    """Compute the exact probabilities for a prompt, assuming that all completions are equally likely.

    A completion is final if it is accepted or if no retry is left. Without retries, the probability of
    passing equals the prompt's pass@1.
    """
    rejected = rejected_share(trials)
    asked, is_last = mean_requests(rejected, retries), rejected**retries

    def chance(end: Callable[[CheckedCompletion], bool]) -> float:
        accepted = sum(trial.accepted and end(trial) for trial in trials)
        others = sum(end(trial) for trial in trials) - accepted
        return min(1.0, (asked * accepted + is_last * others) / len(trials))

    return Chances(
        min(1.0, asked * sum(trial.accepted for trial in trials) / len(trials)),
        chance(lambda trial: trial.ran),
        chance(lambda trial: trial.passed),
    )


def rejected_share(trials: Sequence[CheckedCompletion]) -> float:
    """Return the share of completions that the check rejects."""
    return sum(not trial.accepted for trial in trials) / len(trials)


def mean_requests(rejected: float, retries: int) -> float:
    """Return the mean number of requests per program for a share of rejected completions."""
    return sum(rejected**number for number in range(retries + 1))


@dataclass(frozen=True)
class CheckedPrompt:
    """Groups the checked completions of one prompt."""

    task: str
    prompt: int
    trials: tuple[CheckedCompletion, ...]


def trials_by_prompt(table: pl.DataFrame) -> tuple[CheckedPrompt, ...]:
    """Group completions by prompt, sorted by task and prompt. All of them must have been checked."""
    # A timeout that was judged like a normal end, because programs may wait forever, is not an error.
    judged = pl.col("satisfied") | pl.col("failed_checks").is_not_null()
    completions = table.group_by(KEY, maintain_order=True).agg(
        pl.col("accepted").first(),
        ((pl.col("status") == "finished") | ((pl.col("status") == "timeout") & judged)).all().alias("ran"),
        pl.col("passed").first(),
    )
    together: defaultdict[tuple[str, int], list[CheckedCompletion]] = defaultdict(list)
    for task, prompt, _, accepted, ran, passed in completions.iter_rows():
        together[task, prompt].append(CheckedCompletion(accepted, ran, passed))
    return tuple(CheckedPrompt(*key, tuple(those)) for key, those in sorted(together.items()))


@dataclass(frozen=True)
class RetryResult:
    """The result of rejection sampling over all prompts, for one limit on retries."""

    retries: int
    passed: Estimate  # pass@1
    accepted: float  # share of final programs that the check accepts
    ran: float  # share of final programs that run without an error in every world
    prompts: Mapping[float, float]  # share of prompts that reach each threshold of pass@1
    by_prompt: tuple[Chances, ...]


def resample(prompts: Sequence[CheckedPrompt], retries: int) -> RetryResult:
    """Compute the result of rejection sampling for one limit on retries."""
    each = tuple(final_chances(prompt.trials, retries) for prompt in prompts)
    return RetryResult(
        retries=retries,
        passed=over_tasks((prompt.task, one.passed) for prompt, one in zip(prompts, each, strict=True)),
        accepted=mean_of([[one.accepted for one in each]]),
        ran=mean_of([[one.ran for one in each]]),
        prompts={t: share_at_least([one.passed for one in each], t) for t in THRESHOLDS},
        by_prompt=each,
    )


def accepted_after(prompts: Sequence[CheckedPrompt], most: int) -> list[float]:
    """Return the share of programs that the check accepts after 0, 1, ... `most` retries."""
    rejected = [rejected_share(prompt.trials) for prompt in prompts]
    return [mean_of([[1 - share ** (n + 1) for share in rejected]]) for n in range(most + 1)]


def curve_data(prompts: Sequence[CheckedPrompt], limits: Sequence[int]) -> dict[str, Any]:
    """Compute the data of the paper's two figures on rejection sampling (section VI)."""
    of_limits = [resample(prompts, retries) for retries in limits]
    return {
        "limits": [
            {
                "retries": limit.retries,
                "pass@1": asdict(limit.passed),
                "accepted": limit.accepted,
                "ran": limit.ran,
                "prompts_at_least": {str(t): share for t, share in limit.prompts.items()},
            }
            for limit in of_limits
        ],
        "prompts": [
            {
                "task": prompt.task,
                "prompt": prompt.prompt,
                "completions": len(prompt.trials),
                "accepted": sum(trial.accepted for trial in prompt.trials),
                "passed": sum(trial.passed for trial in prompt.trials),
                "pass@1": {str(limit.retries): limit.by_prompt[i].passed for limit in of_limits},
            }
            for i, prompt in enumerate(prompts)
        ],
        "accepted_after": accepted_after(prompts, max(limits)),
    }
