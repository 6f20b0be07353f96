"""What asking again for each program that the check rejects would have given (paper, section VI).

Whoever checks programs before they run asks for another when one is rejected, up to a limit of retries. From
a run whose completions are both checked and judged, what that gives is known exactly: completions of a prompt
are drawn with replacement; the first that is accepted is kept, or the last where none is.
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
class Trial:
    """One completion, checked and judged."""

    accepted: bool  # the check found no problem
    ran: bool  # without an error in every true world
    passed: bool  # in every true world


@dataclass(frozen=True)
class Chances:
    """What becomes of a prompt, each a chance from 0 to 1."""

    accepted: float  # that the check accepts the program that is kept
    ran: float  # without an error in every true world
    passed: float  # pass@1


def chances(trials: Sequence[Trial], retries: int) -> Chances:
    """What is to be expected of a prompt, exactly, where each completion is drawn as often as any other.

    Each request brings each completion with the same chance. It is kept if it is accepted, or if this is the
    last request. So without retries the chance to pass is the prompt's pass@1, to the last digit.
    """
    rejected = rejected_share(trials)
    asked, is_last = requests(rejected, retries), rejected**retries

    def chance(end: Callable[[Trial], bool]) -> float:
        accepted = sum(trial.accepted and end(trial) for trial in trials)
        others = sum(end(trial) for trial in trials) - accepted
        return min(1.0, (asked * accepted + is_last * others) / len(trials))

    return Chances(
        min(1.0, asked * sum(trial.accepted for trial in trials) / len(trials)),
        chance(lambda trial: trial.ran),
        chance(lambda trial: trial.passed),
    )


def rejected_share(trials: Sequence[Trial]) -> float:
    """The share of completions that the check rejects."""
    return sum(not trial.accepted for trial in trials) / len(trials)


def requests(rejected: float, retries: int) -> float:
    """The requests for a program on average, of which such a share is rejected, with so many retries."""
    return sum(rejected**number for number in range(retries + 1))


@dataclass(frozen=True)
class CheckedPrompt:
    """The completions of one prompt."""

    task: str
    prompt: int
    trials: tuple[Trial, ...]


def trials_by_prompt(table: pl.DataFrame) -> tuple[CheckedPrompt, ...]:
    """The completions of each prompt, which were all checked, in the order of tasks and prompts."""
    # One that waits where it may wait for ever has not erred: there the requirements were looked at.
    judged = pl.col("satisfied") | pl.col("failed_checks").is_not_null()
    completions = table.group_by(KEY, maintain_order=True).agg(
        pl.col("accepted").first(),
        ((pl.col("status") == "finished") | ((pl.col("status") == "timeout") & judged)).all().alias("ran"),
        pl.col("passed").first(),
    )
    together: defaultdict[tuple[str, int], list[Trial]] = defaultdict(list)
    for task, prompt, _, accepted, ran, passed in completions.iter_rows():
        together[task, prompt].append(Trial(accepted, ran, passed))
    return tuple(CheckedPrompt(*key, tuple(those)) for key, those in sorted(together.items()))


@dataclass(frozen=True)
class Limit:
    """What one limit of retries gives, over all prompts."""

    retries: int
    passed: Estimate  # pass@1
    accepted: float  # share of the programs kept
    ran: float  # without an error in every true world
    prompts: Mapping[float, float]  # share of prompts with pass@1 at least the threshold
    by_prompt: tuple[Chances, ...]  # in the order of the prompts


def resampled(prompts: Sequence[CheckedPrompt], retries: int) -> Limit:
    """What a limit of retries would have given."""
    each = tuple(chances(prompt.trials, retries) for prompt in prompts)
    return Limit(
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
    """The data of the paper's two figures (section VI)."""
    of_limits = [resampled(prompts, retries) for retries in limits]
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
