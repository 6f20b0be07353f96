"""Computes cluster bootstraps, sign-flip permutation tests, and sample sizes for 80% power."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from roboeval.analysis.metrics import (
    CONFIDENCE,
    ROUNDING_ERROR,
    SHARE,
    Clusters,
    Estimate,
    SamplingUnit,
    mean_of,
    t_quantile,
)

BOOTSTRAP_SEED = 0
TEST_POWER = 0.8
MIN_CLUSTERS = 8  # with fewer clusters, the bootstrap interval is too narrow
MAX_EXACT_CLUSTERS = 20  # up to this many clusters, all 2**20 sign flips are enumerated
RESAMPLES_AT_ONCE = 1_000  # number of resamples in memory at a time


def by_bootstrap(
    clusters: Clusters,
    *,
    within: tuple[float, float] = SHARE,
    over: SamplingUnit = "prompts",
    seed: int = BOOTSTRAP_SEED,
    draws: int = 10_000,
) -> Estimate:
    """Return the mean of all values with its 95% percentile interval from `draws` resamples of the clusters.

    Plain percentiles are too narrow for few clusters, so they are expanded by the ratio of Student's t to the
    normal distribution (Hesterberg's expanded percentile interval).
    """
    mean, count = mean_of(clusters), len(clusters)
    if count == 1:
        return Estimate(mean, *within, over)
    generator = np.random.default_rng(seed)
    sums = np.array([math.fsum(values) for values in clusters])
    sizes = np.array([len(values) for values in clusters])
    means = []
    for start in range(0, draws, RESAMPLES_AT_ONCE):
        sample = generator.integers(count, size=(min(RESAMPLES_AT_ONCE, draws - start), count))
        means.append(sums[sample].sum(axis=1) / sizes[sample].sum(axis=1))
    wider = math.sqrt(count / (count - 1)) * t_quantile((1 + CONFIDENCE) / 2, count - 1)
    tail = NormalDist().cdf(-wider)
    low, high = np.quantile(np.concatenate(means), [tail, 1 - tail])
    return Estimate(mean, max(within[0], float(low)), min(within[1], float(high)), over)


def p_by_signs(clusters: Clusters, *, seed: int = BOOTSTRAP_SEED, draws: int = 100_000) -> float:
    """Return the p-value of a two-sided permutation test that flips the signs of all values of a cluster.

    The test is exact for up to 20 clusters. For more, `draws` flips are sampled. With G clusters, p is at
    least 2 / 2**G, so a difference between few clusters cannot be significant.
    """
    sums = np.array([math.fsum(values) for values in clusters])
    observed = abs(float(sums.sum())) - ROUNDING_ERROR
    if len(sums) <= MAX_EXACT_CLUSTERS:
        totals = np.zeros(1)
        for one in sums:
            totals = np.concatenate([totals + one, totals - one])
        return float((np.abs(totals) >= observed).mean())
    generator = np.random.default_rng(seed)
    extreme = 0
    for start in range(0, draws, RESAMPLES_AT_ONCE):
        signs = generator.integers(2, size=(min(RESAMPLES_AT_ONCE, draws - start), len(sums))) * 2 - 1
        extreme += int((np.abs(signs @ sums) >= observed).sum())
    return (extreme + 1) / (draws + 1)


@dataclass(frozen=True)
class SampleSizes:
    """The numbers of completions per prompt and of prompts that give 80% power, or None if unknown."""

    completions: int | None  # number per prompt and model, if only these prompts matter
    prompts: int | None  # number of similar prompts, with as many completions per prompt as now


def sample_sizes(pairs: Sequence[tuple[float, float]]) -> SampleSizes:
    """Compute the sample sizes needed to detect the mean difference between pairs of pass@1 with 80% power.

    With n completions per prompt, the difference has the variance (w / n) / m on m given prompts, where w is
    the mean of a (1 - a) + b (1 - b). On m random prompts, the variance is v / m, where v is the variance of
    the differences. A difference is detected if it is at least (z(level) + z(power)) standard errors.
    """
    m = len(pairs)
    differences = [b - a for a, b in pairs]
    mean = math.fsum(differences) / m
    if abs(mean) < ROUNDING_ERROR:
        return SampleSizes(None, None)
    normal = NormalDist()
    factor = ((normal.inv_cdf((1 + CONFIDENCE) / 2) + normal.inv_cdf(TEST_POWER)) / mean) ** 2
    within = math.fsum(a * (1 - a) + b * (1 - b) for a, b in pairs) / m
    spread = math.fsum((d - mean) ** 2 for d in differences) / (m - 1) if m > 1 else None
    prompts = None if spread is None else max(2, math.ceil(factor * spread - ROUNDING_ERROR))
    return SampleSizes(max(1, math.ceil(factor * within / m - ROUNDING_ERROR)), prompts)
