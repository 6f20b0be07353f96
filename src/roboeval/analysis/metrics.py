"""Computes pass@k of prompts, and means over prompts with confidence intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from operator import mul
from typing import Literal, TypeAlias

Clusters: TypeAlias = Sequence[Sequence[float]]
"""Values grouped by cluster: one value per prompt, or the values of all prompts of a task."""

SamplingUnit: TypeAlias = Literal["prompts", "tasks"]
"""The unit of random sampling that an interval assumes: a single prompt, or a task with all its prompts."""

SHARE, DIFFERENCE = (0.0, 1.0), (-1.0, 1.0)  # lowest and highest values
CONFIDENCE = 0.95  # level of all confidence intervals
ROUNDING_ERROR = 1e-9


def pass_at_k(n: int, c: int, k: int) -> float:
    """Return an unbiased estimate of the probability that at least one of k completions passes.

    Args:
        n: The number of judged completions.
        c: The number of judged completions that passed.
        k: The number of attempts.

    Raises:
        ValueError: If c is not in 0..n, or k is not in 1..n.
    """
    if not 0 <= c <= n:
        raise ValueError(f"{c} of {n} completions cannot have passed")
    if not 1 <= k <= n:
        raise ValueError(f"pass@{k} cannot be estimated from {n} completions")
    # Use integers until the division, since 1 - (a ratio near 1) loses precision in floating point.
    draws = math.comb(n, k)
    return (draws - math.comb(n - c, k)) / draws


@dataclass(frozen=True)
class Estimate:
    """A mean with its 95% confidence interval.

    Args:
        mean: The mean of the values.
        low: The lower end of the interval.
        high: The upper end of the interval.
        over: The unit, `prompts` or `tasks`, that the interval assumes to be sampled at random.
    """

    mean: float
    low: float
    high: float
    over: SamplingUnit = "prompts"

    @property
    def is_known(self) -> bool:
        """Whether the interval says anything: False if the values do not vary or are too few."""
        return self.high - self.low > ROUNDING_ERROR and (self.low, self.high) not in (SHARE, DIFFERENCE)

    def ends(self, form: str = ".3f") -> str:
        """Format both ends with `form`, such as `0.310 to 0.540`, or say why the interval is unknown."""
        if self.high - self.low <= ROUNDING_ERROR:
            return f"unknown: no variation between {self.over}"
        if not self.is_known:
            return f"unknown: too few {self.over}"
        return f"{self.low:{form}} to {self.high:{form}}"

    @property
    def interval(self) -> str:
        """The interval in words, such as "95% interval over tasks 0.310 to 0.540"."""
        return f"95% interval over {self.over} {self.ends()}"


@dataclass(frozen=True)
class PromptScore:
    """The numbers of judged and of passed completions of a prompt. Prompts are numbered from 0."""

    task: str
    prompt: int
    completions: int
    passed: int

    def pass_at(self, k: int) -> float:
        """Return pass@k of the prompt. Raise ValueError if it has fewer than k completions."""
        return pass_at_k(self.completions, self.passed, k)


@dataclass(frozen=True)
class TaskScore:
    """The scores of one or more prompts of a task, all weighted equally."""

    task: str
    prompts: tuple[PromptScore, ...]

    @property
    def completions(self) -> int:
        """The number of judged completions."""
        return sum(prompt.completions for prompt in self.prompts)

    @property
    def passed(self) -> int:
        """The number of completions that passed."""
        return sum(prompt.passed for prompt in self.prompts)

    def pass_at(self, k: int) -> Estimate:
        """Return the mean pass@k. Raise ValueError if a prompt has fewer than k completions."""
        return by_formula([[prompt.pass_at(k)] for prompt in self.prompts])

    def lowest(self, k: int) -> float:
        """Return pass@k of the worst prompt, the lower end of the error bars in the paper."""
        return min(prompt.pass_at(k) for prompt in self.prompts)

    def highest(self, k: int) -> float:
        """Return pass@k of the best prompt, the upper end of the error bars in the paper."""
        return max(prompt.pass_at(k) for prompt in self.prompts)


def prompts_of(tasks: Iterable[TaskScore]) -> list[PromptScore]:
    """Return the scores of all prompts of the given tasks as one list."""
    return [prompt for task in tasks for prompt in task.prompts]


def pass_at_1(tasks: Iterable[TaskScore]) -> dict[tuple[str, int], float]:
    """Return pass@1 of each prompt. The key of prompt 0 of CountMen is `("CountMen", 0)`."""
    return {(p.task, p.prompt): p.pass_at(1) for p in prompts_of(tasks)}


def overall(tasks: Iterable[TaskScore], k: int) -> Estimate:
    """Return mean pass@k over prompts, with its interval over tasks. Raise ValueError if k is too large."""
    return over_tasks((prompt.task, prompt.pass_at(k)) for prompt in prompts_of(tasks))


def over_tasks(values: Iterable[tuple[str, float]], *, within: tuple[float, float] = SHARE) -> Estimate:
    """Return the mean of (task, value) pairs, with its 95% interval over tasks, clipped to `within`."""
    by_task: dict[str, list[float]] = {}
    for task, value in values:
        by_task.setdefault(task, []).append(value)
    return by_formula([*by_task.values()], within=within, over="tasks")


def share_at_least(values: Sequence[float], threshold: float) -> float:
    """Return the share of values that are at least `threshold`, apart from rounding errors."""
    return sum(value >= threshold - ROUNDING_ERROR for value in values) / len(values)


def percent(share: float) -> str:
    """Format a share as percent without the sign, such as "42", or "<1" or ">99" close to 0 or 1."""
    if 0 < share < 0.01:  # noqa: PLR2004 - one percent
        return "<1"
    return ">99" if 0.99 < share < 1 else f"{100 * share:.0f}"  # noqa: PLR2004 - 99 percent


def threshold_curve(values: Sequence[float]) -> list[tuple[float, float]]:
    """Return pairs of a threshold and the share of values that reach it, from 1 down (paper, section V.A)."""
    thresholds = sorted({1.0, *(value for value in values if value > ROUNDING_ERROR)}, reverse=True)
    return [(threshold, share_at_least(values, threshold)) for threshold in thresholds]


def by_formula(
    clusters: Clusters, *, within: tuple[float, float] = SHARE, over: SamplingUnit = "prompts"
) -> Estimate:
    """Return the mean of all values with its cluster-robust 95% interval, clipped to `within`.

    The variance of the mean is G / (G - 1) * sum over clusters of (sum of (value - mean))**2 / N**2, for G
    clusters with N values. The interval uses Student's t with G - 1 degrees of freedom. With one value per
    cluster, it is the usual interval of a mean. For a single cluster, it is the whole range.
    """
    mean, count = mean_of(clusters), len(clusters)
    if count == 1:
        return Estimate(mean, *within, over)
    residuals = [math.fsum(value - mean for value in values) for values in clusters]
    size = sum(map(len, clusters))
    variance = count / (count - 1) * math.fsum(r * r for r in residuals) / size**2
    margin = t_quantile((1 + CONFIDENCE) / 2, count - 1) * math.sqrt(variance)
    return Estimate(mean, max(within[0], mean - margin), min(within[1], mean + margin), over)


def mean_of(clusters: Clusters) -> float:
    """Return the mean of all values. There must be at least one."""
    return math.fsum(value for values in clusters for value in values) / sum(map(len, clusters))


@lru_cache(maxsize=1024)
def t_quantile(p: float, df: int) -> float:
    """Return the p-quantile of Student's t distribution with `df` degrees of freedom, for p >= 1/2."""
    # With angle = atan(t / sqrt(df)), the probability is a finite sum and the bisection has a bounded range.
    low, high = 0.0, math.pi / 2
    while low < (angle := (low + high) / 2) < high:
        low, high = (angle, high) if _within(angle, df) < 2 * p - 1 else (low, angle)
    return math.sqrt(df) * math.tan(low)


def _within(angle: float, df: int) -> float:
    """Return the probability that |t| < sqrt(df) * tan(angle) (Abramowitz and Stegun, 26.7.3 and 26.7.4)."""
    if df == 1:
        return 2 / math.pi * angle
    is_odd = df % 2
    factors = (math.cos(angle) ** 2 * (i - 1) / i for i in range(2 + is_odd, df, 2))
    series = math.fsum(accumulate(factors, mul, initial=math.cos(angle) if is_odd else 1.0))
    return 2 / math.pi * (angle + math.sin(angle) * series) if is_odd else math.sin(angle) * series
