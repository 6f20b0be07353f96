"""How sure a mean over prompts is: intervals with clusters, by a formula and by resampling, and tests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from roboeval.analysis.metrics import LEVEL, SHARE, Clusters, Draws, Estimate, mean_of, t_quantile

SEED = 0
POWER = 0.8
FEW = 8  # clusters below which the bootstrap knows too few means, so that its interval is too narrow
EXACT = 20  # so many clusters have 2 to the power of 20 signs, all of which are tried
ROUNDING = 1e-12
CHUNK = 1_000  # draws that are held at one time


def by_bootstrap(
    clusters: Clusters,
    *,
    within: tuple[float, float] = SHARE,
    over: Draws = "prompts",
    seed: int = SEED,
    draws: int = 10_000,
) -> Estimate:
    """The mean of all values, with an interval from clusters drawn again, with replacement.

    Each draw takes as many clusters as there are, whole, and notes the mean of their values. The interval
    lies between two percentiles of these means. With few clusters, plain percentiles are too narrow; they are
    moved outwards, as far as Student's t is wider than the normal distribution (Hesterberg's expanded
    percentiles).
    """
    mean, count = mean_of(clusters), len(clusters)
    if count == 1:
        return Estimate(mean, *within, over)
    dice = np.random.default_rng(seed)
    sums = np.array([math.fsum(values) for values in clusters])
    sizes = np.array([len(values) for values in clusters])
    means = []
    for start in range(0, draws, CHUNK):
        drawn = dice.integers(count, size=(min(CHUNK, draws - start), count))
        means.append(sums[drawn].sum(axis=1) / sizes[drawn].sum(axis=1))
    wider = math.sqrt(count / (count - 1)) * t_quantile((1 + LEVEL) / 2, count - 1)
    tail = NormalDist().cdf(-wider)
    low, high = np.quantile(np.concatenate(means), [tail, 1 - tail])
    return Estimate(mean, max(within[0], float(low)), min(within[1], float(high)), over)


def p_by_signs(clusters: Clusters, *, seed: int = SEED, draws: int = 100_000) -> float:
    """How often chance alone gives a mean difference as far from 0 as this one.

    If neither of two models were better, the differences of a cluster could as well have the other sign, all
    of them together. Up to 20 clusters, all signs are tried, and the answer is exact; else signs are drawn.
    It is at least 2 / 2**G for G clusters, so that few clusters cannot tell.
    """
    sums = np.array([math.fsum(values) for values in clusters])
    seen = abs(float(sums.sum())) - ROUNDING
    if len(sums) <= EXACT:
        totals = np.zeros(1)
        for one in sums:
            totals = np.concatenate([totals + one, totals - one])
        return float((np.abs(totals) >= seen).mean())
    dice = np.random.default_rng(seed)
    as_far = 0
    for start in range(0, draws, CHUNK):
        signs = dice.integers(2, size=(min(CHUNK, draws - start), len(sums))) * 2 - 1
        as_far += int((np.abs(signs @ sums) >= seen).sum())
    return (as_far + 1) / (draws + 1)


@dataclass(frozen=True)
class Needed:
    """The sample sizes for 80% power to distinguish two models; None where they do not differ."""

    completions: int | None  # of each model for each of these prompts, if only these matter
    prompts: int | None  # like these, with as many completions each, if others matter as well


def needed(pairs: Sequence[tuple[float, float]]) -> Needed:
    """How many completions or prompts would tell a difference as large as that between pairs of pass@1.

    For n completions a prompt, the difference has the variance (w / n) / m on m given prompts, where w is the
    mean of a (1 - a) + b (1 - b); on m prompts drawn at random it has v / m, where v is the variance of the
    differences between prompts. It is told where it is at least (z(level) + z(power)) standard errors.
    """
    m = len(pairs)
    differences = [b - a for a, b in pairs]
    mean = math.fsum(differences) / m
    if abs(mean) < ROUNDING:
        return Needed(None, None)
    normal = NormalDist()
    factor = ((normal.inv_cdf((1 + LEVEL) / 2) + normal.inv_cdf(POWER)) / mean) ** 2
    drawn = math.fsum(a * (1 - a) + b * (1 - b) for a, b in pairs) / m
    spread = math.fsum((d - mean) ** 2 for d in differences) / (m - 1) if m > 1 else None
    prompts = None if spread is None else max(2, math.ceil(factor * spread - ROUNDING))
    return Needed(max(1, math.ceil(factor * drawn / m - ROUNDING)), prompts)
