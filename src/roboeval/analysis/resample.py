"""Computes the pass rate if programs that the check rejects are requested again (paper, section VI).

This rejection sampling draws completions of a prompt with replacement until one of them is accepted or the
limit on retries is reached. If all completions of a run were checked and judged, the result is exact.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import polars as pl

from roboeval.analysis.metrics import Estimate, mean_of, over_tasks, share_at_least
from roboeval.evaluation.runs.completions import KEY

LIMITS = (0, 2, 4, 8, 100)
THRESHOLDS = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class CheckedPrompt:
    """The numbers of a prompt's completions that the check accepts, that run without error, and that pass."""

    task: str
    prompt: int
    completions: int
    accepted: int  # the check found no problem
    ran: int  # without an error in every world of the task
    passed: int
    accepted_and_ran: int
    accepted_and_passed: int

    @property
    def rejected(self) -> float:
        """The share of completions that the check rejects."""
        return (self.completions - self.accepted) / self.completions


@dataclass(frozen=True)
class Chances:
    """The probabilities that the final program of a prompt is accepted, runs without error, and passes."""

    accepted: float
    ran: float
    passed: float


def final_chances(prompt: CheckedPrompt, retries: int) -> Chances:
    """Return the chances of a prompt's final program under rejection sampling.

    Each request returns one of the prompt's completions at random. The final program is the first one that
    the check accepts, or the last one. Without retries, `passed` equals the prompt's pass@1.
    """
    asked, is_last = mean_requests(prompt.rejected, retries), prompt.rejected**retries

    def chance(accepted: int, every: int) -> float:
        return min(1.0, (asked * accepted + is_last * (every - accepted)) / prompt.completions)

    return Chances(
        chance(prompt.accepted, prompt.accepted),
        chance(prompt.accepted_and_ran, prompt.ran),
        chance(prompt.accepted_and_passed, prompt.passed),
    )


def mean_requests(rejected: float, retries: int) -> float:
    """Return the mean number of requests per program: 1.5 if half are rejected and one retry is allowed."""
    return sum(rejected**number for number in range(retries + 1))


def count_by_prompt(table: pl.DataFrame) -> tuple[CheckedPrompt, ...]:
    """Count completions by prompt, sorted by task and prompt. All of them must have been checked."""
    # A timeout that was judged like a normal end, because programs may wait forever, is not an error.
    judged = pl.col("satisfied") | pl.col("failed_checks").is_not_null()
    has_ended = (pl.col("status") == "finished") | ((pl.col("status") == "timeout") & judged)
    accepted, ran, passed = pl.col("accepted"), pl.col("ran"), pl.col("passed")
    completions = table.group_by(KEY).agg(accepted.first(), has_ended.all().alias("ran"), passed.first())
    counted = completions.group_by("task", "prompt").agg(
        completions=pl.len(),
        accepted=accepted.sum(),
        ran=ran.sum(),
        passed=passed.sum(),
        accepted_and_ran=(accepted & ran).sum(),
        accepted_and_passed=(accepted & passed).sum(),
    )
    return tuple(CheckedPrompt(**row) for row in counted.sort("task", "prompt").iter_rows(named=True))


@dataclass(frozen=True)
class RetryResult:
    """The result of rejection sampling over all prompts, with at most `retries` retries per program."""

    retries: int
    passed: Estimate  # pass@1
    accepted: float  # share of final programs that the check accepts
    ran: float  # share of final programs that run without an error in every world
    prompts: Mapping[float, float]  # share of prompts that reach each threshold of pass@1
    by_prompt: tuple[Chances, ...]


def resample(prompts: Sequence[CheckedPrompt], retries: int) -> RetryResult:
    """Compute the result of rejection sampling with at most `retries` retries per program."""
    each = tuple(final_chances(prompt, retries) for prompt in prompts)
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
    return [mean_of([[1 - prompt.rejected ** (n + 1) for prompt in prompts]]) for n in range(most + 1)]


def curve_data(prompts: Sequence[CheckedPrompt], limits: Sequence[int]) -> dict[str, Any]:
    """Return the results for each limit on retries, in total and by prompt, as JSON data for `--json`."""
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
                "completions": prompt.completions,
                "accepted": prompt.accepted,
                "passed": prompt.passed,
                "pass@1": {str(limit.retries): limit.by_prompt[i].passed for limit in of_limits},
            }
            for i, prompt in enumerate(prompts)
        ],
        "accepted_after": accepted_after(prompts, max(limits)),
    }
