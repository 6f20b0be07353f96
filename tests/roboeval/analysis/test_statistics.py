"""Intervals and tests: cases computed by hand, and how often intervals cover the true value."""

import math
import random
from collections.abc import Callable
from itertools import product
from statistics import NormalDist

import pytest

from roboeval.analysis.metrics import DIFFERENCE, Clusters, Estimate, by_formula
from roboeval.analysis.statistics import (
    SampleSizes,
    by_bootstrap,
    p_by_signs,
    sample_sizes,
)


def test_the_formula_by_hand() -> None:
    # Means of clusters 0.25 and 0.75, of two values each: residual sums -0.5 and 0.5, so that the variance is
    # 2 / 1 * 0.5 / 16 = 1 / 16, and Student's t with one degree of freedom is 12.706.
    found = by_formula([[0.0, 0.5], [0.5, 1.0]], within=(-9, 9))
    assert found.mean == 0.5
    assert found.high - 0.5 == pytest.approx(12.7062 / 4, abs=1e-4)
    assert by_formula([[0.0, 0.5], [0.5, 1.0]]) == Estimate(0.5, 0.0, 1.0)


def test_clusters_of_different_size() -> None:
    found = by_formula([[1.0, 1.0, 1.0], [0.0]], within=(-9, 9))
    # The mean is 3 / 4, the residual sums are 3 / 4 and -3 / 4: 2 * 2 * 9 / 16 / 16.
    assert found.mean == 0.75
    assert found.high - 0.75 == pytest.approx(12.7062 * math.sqrt(36 / 256), abs=1e-3)


def test_one_cluster_says_nothing_about_others() -> None:
    for method in (by_formula, by_bootstrap):
        assert method([[0.5, 0.6]]) == Estimate(0.55, 0.0, 1.0)
        assert method([[0.5]], within=DIFFERENCE) == Estimate(0.5, -1.0, 1.0)


def test_equal_clusters_have_an_interval_without_width() -> None:
    for method in (by_formula, by_bootstrap):
        assert method([[1.0, 0.0]] * 6) == Estimate(0.5, 0.5, 0.5)


def test_the_same_seed_repeats_the_bootstrap() -> None:
    clusters = [[n / 10, n / 20] for n in range(8)]
    assert by_bootstrap(clusters, seed=3) == by_bootstrap(clusters, seed=3)
    assert by_bootstrap(clusters, seed=3) != by_bootstrap(clusters, seed=4)


def test_the_bootstrap_of_two_clusters_by_hand() -> None:
    # The means of two draws are 0, 0.5, 0.5 or 1; expanded percentiles of two clusters are the ends.
    assert by_bootstrap([[0.0], [1.0]]) == Estimate(0.5, 0.0, 1.0)


def test_the_bootstrap_is_as_wide_as_the_formula_where_values_are_normal() -> None:
    # Plain percentiles would be narrower by the square root of 11 / 12, and by 1.96 over Student's t.
    normal = NormalDist(0.5, 0.1)
    clusters = [[normal.inv_cdf((n + 0.5) / 12)] for n in range(12)]
    formula, drawn = by_formula(clusters), by_bootstrap(clusters, draws=40_000)
    assert drawn.high - drawn.low == pytest.approx(formula.high - formula.low, rel=0.02)


METHODS: dict[str, Callable[[Clusters, int], Estimate]] = {
    "formula": lambda clusters, _: by_formula(clusters),
    "bootstrap": lambda clusters, seed: by_bootstrap(clusters, seed=seed, draws=1_000),
}


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tasks", [6, 16])
def test_intervals_cover_the_true_value_about_as_often_as_stated(method: str, tasks: int) -> None:
    chance = random.Random(7)
    times = 400
    held = 0
    for time in range(times):
        clusters = []
        for _ in range(tasks):
            ability = chance.betavariate(2, 2)
            prompts = [chance.betavariate(1 + 8 * ability, 9 - 8 * ability) for _ in range(5)]
            clusters.append([sum(chance.random() < p for _ in range(10)) / 10 for p in prompts])
        found = METHODS[method](clusters, time)
        held += found.low <= 0.5 <= found.high
    assert 0.92 <= held / times <= 0.985


def test_treating_prompts_as_independent_covers_it_less_often() -> None:
    chance = random.Random(8)
    held = 0
    for _ in range(300):
        abilities = [chance.random() for _ in range(8)]
        values = [[ability] for ability in abilities for _ in range(5)]
        found = by_formula(values)
        held += found.low <= 0.5 <= found.high
    assert held / 300 < 0.8


# --- p values


def test_signs_by_hand() -> None:
    # Of the eight signs of 0.1, 0.2 and 0.3, two give a sum as far from 0 as 0.6.
    assert p_by_signs([[0.1], [0.2], [0.3]]) == 2 / 8
    # Four give one of at least 0.4: both 0.6, and -0.1 with the others.
    assert p_by_signs([[-0.1], [0.2], [0.3]]) == 4 / 8
    assert p_by_signs([[0.1, 0.5], [0.2, 0.4]]) == 2 / 4
    assert p_by_signs([[0.0], [0.0]]) == 1.0


def test_exact_p_values_try_all_signs() -> None:
    chance = random.Random(3)
    sums = [chance.uniform(-1, 1.5) for _ in range(9)]
    seen = abs(sum(sums))
    as_far = [
        abs(sum(s * one for s, one in zip(signs, sums, strict=True))) >= seen - 1e-12
        for signs in product((-1, 1), repeat=9)
    ]
    assert p_by_signs([[one] for one in sums]) == pytest.approx(sum(as_far) / 2**9)


def test_p_values_of_random_signs_are_close_to_exact_ones() -> None:
    chance = random.Random(5)
    sums = [chance.gauss(0.25, 1) for _ in range(20)]
    exact = p_by_signs([[one] for one in sums])
    drawn = p_by_signs([[one] for one in [*sums, 0.0]])  # 21 clusters get random signs; a 0 changes no sum.
    assert drawn == pytest.approx(exact, abs=0.006)
    assert p_by_signs([[1.0]] * 40) == 1 / 100_001


def test_p_is_rarely_small_without_a_difference() -> None:
    chance = random.Random(2)
    small = 0
    for _ in range(500):
        clusters = [[chance.choice((-1, 1)) * chance.random()] * 5 for _ in range(10)]
        small += p_by_signs(clusters) <= 0.05
    assert 0.02 <= small / 500 <= 0.08


# --- sample sizes


def test_sample_sizes_by_hand() -> None:
    # One prompt each way: a (1 - a) + b (1 - b) = 0.25 + 0.24; (1.96 + 0.8416)**2 = 7.849 over 0.01.
    found = sample_sizes([(0.5, 0.6), (0.5, 0.6)])
    assert found.completions == math.ceil(7.849 / 0.01 * 0.49 / 2)
    assert found.prompts == 2
    # Differences 0 and 0.4: mean 0.2, variance 0.08.
    assert sample_sizes([(0.0, 0.0), (0.0, 0.4)]).prompts == math.ceil(7.849 / 0.04 * 0.08)


def test_no_sample_size_detects_equal_scores() -> None:
    assert sample_sizes([(0.5, 0.6), (0.6, 0.5)]) == SampleSizes(None, None)
    assert sample_sizes([(0.0, 1.0)]) == SampleSizes(1, None)


def test_the_sample_size_detects_a_difference_four_times_in_five() -> None:
    chance = random.Random(9)
    true = [(0.3, 0.45), (0.6, 0.7), (0.5, 0.55), (0.2, 0.4)]
    n = sample_sizes(true).completions
    assert n is not None
    detected = 0
    for _ in range(300):
        total = variance = 0.0
        for a, b in true:
            one, two = (sum(chance.random() < p for _ in range(n)) / n for p in (a, b))
            total += two - one
            variance += (one * (1 - one) + two * (1 - two)) / n
        detected += total > 1.96 * math.sqrt(variance)
    assert detected / 300 == pytest.approx(0.8, abs=0.07)
