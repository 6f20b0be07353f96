"""How good a model is: pass@k for each prompt, and means over prompts with honest intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate
from operator import mul
from typing import Literal, TypeAlias

# Values, those that resemble each other together: a prompt's, or those of all prompts of a task.
Clusters: TypeAlias = Sequence[Sequence[float]]

Draws: TypeAlias = Literal["prompts", "tasks"]
"""What an interval takes as drawn at random."""

SHARE, DIFFERENCE = (0.0, 1.0), (-1.0, 1.0)  # what values may be
LEVEL = 0.95  # how often intervals hold the true mean
ROUNDING = 1e-9  # what sums of shares may lack of a threshold


def pass_at_k(n: int, c: int, k: int) -> float:
    """The chance that at least one of k completions passes, estimated without bias from n of which c pass.

    Args:
        n: how many completions were judged.
        c: how many of them passed.
        k: how many tries there are.

    Raises:
        ValueError: not 0 <= c <= n, or not 1 <= k <= n.
    """
    if not 0 <= c <= n:
        raise ValueError(f"{c} of {n} completions cannot have passed")
    if not 1 <= k <= n:
        raise ValueError(f"pass@{k} cannot be estimated from {n} completions")
    # Integers up to the one division: 1 - (a ratio near 1) in floating point would lose most digits.
    draws = math.comb(n, k)
    return (draws - math.comb(n - c, k)) / draws


@dataclass(frozen=True)
class Estimate:
    """A mean and the interval in which the true one lies.

    Args:
        mean: the mean of the values.
        low: the lower end of the interval, at least 0.
        high: its upper end, at most 1.
        over: what the interval takes as drawn at random.
    """

    mean: float
    low: float
    high: float
    over: Draws = "prompts"

    @property
    def is_known(self) -> bool:
        """Whether the interval says anything; that of equal values has no width, that of one all of it."""
        return self.high - self.low > ROUNDING and (self.low, self.high) not in (SHARE, DIFFERENCE)

    def ends(self, form: str = ".3f") -> str:
        """The interval for people, in a number format."""
        if self.high - self.low <= ROUNDING:
            return f"unknown: all {self.over} are alike"
        if not self.is_known:
            return f"unknown: too few {self.over}"
        return f"{self.low:{form}} to {self.high:{form}}"

    @property
    def interval(self) -> str:
        """The interval for people, with its name."""
        return f"95% interval over {self.over} {self.ends()}"


@dataclass(frozen=True)
class PromptScore:
    """How the completions of one prompt did.

    Args:
        task: the prompt's task.
        prompt: its number, from 0.
        n: how many completions were judged.
        c: how many of them passed.
    """

    task: str
    prompt: int
    n: int
    c: int

    def pass_at(self, k: int) -> float:
        """The prompt's pass@k; raises ValueError if it has fewer than k completions."""
        if k > self.n:
            raise ValueError(
                f"{self.task}, prompt {self.prompt}: pass@{k} cannot be estimated from {self.n} completions"
            )
        return pass_at_k(self.n, self.c, k)


@dataclass(frozen=True)
class TaskScore:
    """How the prompts of one task did; each prompt counts the same, however many completions it has.

    Args:
        task: its name.
        prompts: the scores of its prompts, at least one, by number.
    """

    task: str
    prompts: tuple[PromptScore, ...]

    def pass_at(self, k: int) -> Estimate:
        """The mean pass@k over prompts, with its 95% interval over prompts of this task.

        Raises:
            ValueError: a prompt, which is named, has fewer than k completions.
        """
        return by_formula([[prompt.pass_at(k)] for prompt in self.prompts])

    def lowest(self, k: int) -> float:
        """The worst prompt's pass@k, the lower end of the paper's error bars; raises as `pass_at` does."""
        return min(prompt.pass_at(k) for prompt in self.prompts)

    def highest(self, k: int) -> float:
        """The best prompt's pass@k, the upper end of the paper's error bars; raises as `pass_at` does."""
        return max(prompt.pass_at(k) for prompt in self.prompts)


def judged_count(prompts: Iterable[PromptScore]) -> int:
    """How many completions of some prompts were judged."""
    return sum(prompt.n for prompt in prompts)


def passed_count(prompts: Iterable[PromptScore]) -> int:
    """How many completions of some prompts passed."""
    return sum(prompt.c for prompt in prompts)


def prompts_of(tasks: Iterable[TaskScore]) -> list[PromptScore]:
    """The scores of all prompts of some tasks."""
    return [prompt for task in tasks for prompt in task.prompts]


def pass_at_1(tasks: Iterable[TaskScore]) -> dict[tuple[str, int], float]:
    """pass@1 by task and prompt."""
    return {(p.task, p.prompt): p.pass_at(1) for p in prompts_of(tasks)}


def overall(tasks: Iterable[TaskScore], k: int) -> Estimate:
    """The mean pass@k over all prompts of all tasks, with its 95% interval over tasks.

    Terminal, card, report, pages and JSON all show this interval.

    Raises:
        ValueError: a prompt, which is named, has fewer than k completions.
    """
    return over_tasks((prompt.task, prompt.pass_at(k)) for prompt in prompts_of(tasks))


def over_tasks(values: Iterable[tuple[str, float]], *, within: tuple[float, float] = SHARE) -> Estimate:
    """The mean of a value of each prompt, given with its task, and its 95% interval over tasks."""
    by_task: dict[str, list[float]] = {}
    for task, value in values:
        by_task.setdefault(task, []).append(value)
    return by_formula([*by_task.values()], within=within, over="tasks")


def share_at_least(values: Sequence[float], threshold: float) -> float:
    """The share of values, at least one, that reach a threshold above 0."""
    return sum(value >= threshold - ROUNDING for value in values) / len(values)


def threshold_curve(values: Sequence[float]) -> list[tuple[float, float]]:
    """The share of prompts that reach each pass@1 at which it changes, from 1 down (paper, section V.A)."""
    thresholds = sorted({1.0, *(value for value in values if value > ROUNDING)}, reverse=True)
    return [(threshold, share_at_least(values, threshold)) for threshold in thresholds]


def by_formula(
    clusters: Clusters, *, within: tuple[float, float] = SHARE, over: Draws = "prompts"
) -> Estimate:
    """The mean of all values, with an interval that takes clusters as drawn at random, clipped to `within`.

    The variance of the mean is G / (G - 1) * sum over clusters of (sum of (value - mean))**2 / N**2, for G
    clusters with N values, and the interval is Student's t with G - 1 degrees of freedom. Where every cluster
    has one value it is the ordinary interval of a mean. One cluster says nothing about others.
    """
    mean, count = mean_of(clusters), len(clusters)
    if count == 1:
        return Estimate(mean, *within, over)
    residuals = [math.fsum(value - mean for value in values) for values in clusters]
    size = sum(map(len, clusters))
    variance = count / (count - 1) * math.fsum(r * r for r in residuals) / size**2
    margin = t_quantile((1 + LEVEL) / 2, count - 1) * math.sqrt(variance)
    return Estimate(mean, max(within[0], mean - margin), min(within[1], mean + margin), over)


def mean_of(clusters: Clusters) -> float:
    """The mean of all values, of which there is one at least; that of prompts is the same everywhere."""
    return math.fsum(value for values in clusters for value in values) / sum(map(len, clusters))


@lru_cache(maxsize=1024)
def t_quantile(p: float, df: int) -> float:
    """The value that Student's t, with so many degrees of freedom, stays below with probability p >= 1/2."""
    # With angle = atan(t / sqrt(df)) the probability is a finite sum, and the range to search is bounded.
    low, high = 0.0, math.pi / 2
    while low < (angle := (low + high) / 2) < high:
        low, high = (angle, high) if _within(angle, df) < 2 * p - 1 else (low, angle)
    return math.sqrt(df) * math.tan(low)


def _within(angle: float, df: int) -> float:
    """The chance that |t| stays below sqrt(df) * tan(angle) (Abramowitz and Stegun, 26.7.3 and 26.7.4)."""
    if df == 1:
        return 2 / math.pi * angle
    is_odd = df % 2
    factors = (math.cos(angle) ** 2 * (i - 1) / i for i in range(2 + is_odd, df, 2))
    series = math.fsum(accumulate(factors, mul, initial=math.cos(angle) if is_odd else 1.0))
    return 2 / math.pi * (angle + math.sin(angle) * series) if is_odd else math.sin(angle) * series
