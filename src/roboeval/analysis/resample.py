"""Rejection sampling: the pass rate when programs that the check rejects are requested again (section VI).

For a run whose completions are checked and judged, the result is known exactly: completions of a prompt are
sampled with replacement until one is accepted or the limit of retries is reached.
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
    """A completion that was checked and judged."""

    accepted: bool  # the check found no problem
    ran: bool  # without an error in every world of its task
    passed: bool


@dataclass(frozen=True)
class Chances:
    """The probabilities that the final program of a prompt is accepted, runs without error, and passes."""

    accepted: float
    ran: float
    passed: float


def final_chances(trials: Sequence[CheckedCompletion], retries: int) -> Chances:
    """Compute the exact probabilities for a prompt, if each request returns any completion equally likely.

    A completion is final if it is accepted or if no retry is left. Without retries, the probability to pass
    is exactly the prompt's pass@1.
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
    """The share of completions that the check rejects."""
    return sum(not trial.accepted for trial in trials) / len(trials)


def mean_requests(rejected: float, retries: int) -> float:
    """The mean number of requests per program, given the share of rejected ones and the limit of retries."""
    return sum(rejected**number for number in range(retries + 1))


@dataclass(frozen=True)
class CheckedPrompt:
    """The checked completions of one prompt."""

    task: str
    prompt: int
    trials: tuple[CheckedCompletion, ...]


def trials_by_prompt(table: pl.DataFrame) -> tuple[CheckedPrompt, ...]:
    """Collect the checked completions of each prompt, sorted by task and prompt; all must be checked."""
    # A timeout is no error in a world in which a program may wait for ever: its requirements were evaluated.
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
    """The result of one limit of retries, over all prompts."""

    retries: int
    passed: Estimate  # pass@1
    accepted: float  # share of final programs
    ran: float  # share that runs without an error in every world of its task
    prompts: Mapping[float, float]  # share of prompts by threshold of pass@1
    by_prompt: tuple[Chances, ...]


def resample(prompts: Sequence[CheckedPrompt], retries: int) -> RetryResult:
    """Compute the result of one limit of retries."""
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
    """The share of programs that the check accepts after 0, 1, ... `most` retries."""
    rejected = [rejected_share(prompt.trials) for prompt in prompts]
    return [mean_of([[1 - share ** (n + 1) for share in rejected]]) for n in range(most + 1)]


def curve_data(prompts: Sequence[CheckedPrompt], limits: Sequence[int]) -> dict[str, Any]:
    """The data of the paper's two figures on rejection sampling (section VI)."""
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
