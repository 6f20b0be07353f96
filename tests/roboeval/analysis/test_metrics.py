import itertools
import math
import random
import re
from collections.abc import Sequence
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from made_results import table_of
from roboeval.analysis.counting.counts import task_scores
from roboeval.analysis.metrics import (
    Estimate,
    PromptScore,
    TaskScore,
    by_formula,
    overall,
    pass_at_k,
    share_at_least,
    t_quantile,
    threshold_curve,
)

COUNTS = st.integers(1, 60).flatmap(
    lambda n: st.tuples(st.just(n), st.integers(0, n), st.integers(1, n)),
)
VALUES = st.lists(st.floats(0, 1), min_size=1, max_size=30)


@pytest.mark.parametrize(
    ("n", "c", "k", "expected"),
    [
        (1, 0, 1, 0),
        (1, 1, 1, 1),
        (50, 10, 1, 0.2),
        (4, 2, 2, 5 / 6),
        (5, 1, 3, 0.6),
        (10, 3, 8, 1),
        (50, 1, 50, 1),
    ],
)
def test_pass_at_k_by_hand(n: int, c: int, k: int, expected: float) -> None:
    assert pass_at_k(n, c, k) == pytest.approx(expected, rel=1e-15)


@given(COUNTS)
def test_pass_at_k_has_its_bounds(counts: tuple[int, int, int]) -> None:
    n, c, k = counts
    value = pass_at_k(n, c, k)
    assert 0 <= value <= 1
    assert pass_at_k(n, n, k) == 1
    assert pass_at_k(n, 0, k) == 0
    assert pass_at_k(n, c, 1) == c / n
    assert k == n or value <= pass_at_k(n, c, k + 1)
    assert c == n or value <= pass_at_k(n, c + 1, k)


@pytest.mark.parametrize("n", range(1, 8))
def test_pass_at_k_counts_subsets(n: int) -> None:
    for c, k in itertools.product(range(n + 1), range(1, n + 1)):
        subsets = list(itertools.combinations([True] * c + [False] * (n - c), k))
        assert pass_at_k(n, c, k) == float(Fraction(sum(map(any, subsets)), len(subsets)))


@pytest.mark.parametrize(
    ("n", "c", "k"), [(10_000, 1, 1), (10_000, 1, 5_000), (10_000, 1, 9_999), (9_999, 1, 7)]
)
def test_pass_at_k_is_exact_for_many(n: int, c: int, k: int) -> None:
    assert pass_at_k(n, c, k) == k / n
    assert pass_at_k(n, n // 2, k) <= 1


@pytest.mark.parametrize(
    ("n", "c", "k", "named"),
    [
        (5, 1, 6, "pass@6 .* 5 completions"),
        (5, 1, 0, "pass@0 .* 5 completions"),
        (0, 0, 1, "pass@1 .* 0 completions"),
        (5, 6, 1, "6 of 5 completions"),
        (5, -1, 1, "-1 of 5 completions"),
    ],
)
def test_pass_at_k_out_of_range(n: int, c: int, k: int, named: str) -> None:
    with pytest.raises(ValueError, match=f"^{named}"):
        pass_at_k(n, c, k)


@pytest.mark.parametrize(
    ("p", "df", "expected"),
    [
        (0.975, 1, math.tan(0.475 * math.pi)),
        (0.975, 2, 0.95 * math.sqrt(2 / (1 - 0.95**2))),
        (0.975, 3, 3.182446305),
        (0.975, 4, 2.776445105),
        (0.975, 79, 1.990450210),
        (0.975, 1_000, 1.962339081),
        (0.995, 10, 3.169272673),
        (0.95, 5, 2.015048373),
        (0.9995, 1, math.tan(0.4995 * math.pi)),
        (0.5, 7, 0),
    ],
)
def test_t_quantile_against_tables(p: float, df: int, expected: float) -> None:
    assert t_quantile(p, df) == pytest.approx(expected, abs=1e-8)


def test_t_quantile_of_1_4_and_79_degrees_of_freedom() -> None:
    assert round(t_quantile(0.975, 1), 4) == 12.7062
    assert round(t_quantile(0.975, 4), 5) == 2.77645
    assert round(t_quantile(0.975, 79), 5) == 1.99045


def over_prompts(values: Sequence[float]) -> Estimate:
    return by_formula([[value] for value in values])


def test_interval_by_hand() -> None:
    assert over_prompts([0.4, 0.6]) == Estimate(0.5, 0, 1)
    found = over_prompts([0.4, 0.5, 0.6])
    margin = 4.302652730 * math.sqrt(0.01 / 3)
    assert [found.mean, found.low, found.high] == pytest.approx([0.5, 0.5 - margin, 0.5 + margin])


def test_interval_of_one_prompt_is_the_whole_range() -> None:
    assert over_prompts([0.3]) == Estimate(0.3, 0, 1)


def test_interval_of_equal_prompts_is_a_point() -> None:
    assert over_prompts([1, 1, 1]) == Estimate(1, 1, 1)


@given(VALUES)
def test_interval_holds_the_mean(values: list[float]) -> None:
    found = over_prompts(values)
    assert 0 <= found.low <= found.mean <= found.high <= 1


@pytest.mark.slow
@pytest.mark.parametrize(("alpha", "beta"), [(2, 3), (0.5, 0.5), (6, 2)])
def test_interval_covers_as_often_as_it_says(alpha: float, beta: float) -> None:
    chance, prompts, completions, times = random.Random(7), 80, 10, 1500
    true = alpha / (alpha + beta)
    covered = 0
    for _ in range(times):
        rates = (chance.betavariate(alpha, beta) for _ in range(prompts))
        found = over_prompts(
            [sum(chance.random() < rate for _ in range(completions)) / completions for rate in rates]
        )
        covered += found.low <= true <= found.high
    assert 0.93 <= covered / times <= 0.97


ROWS = [
    ("B", 1, True),
    ("B", 0, True),
    ("A", 0, False),
    ("B", 1, False),
    ("B", 0, True),
    ("A", 0, True),
    ("B", 1, False),
]
TABLE = table_of(
    {
        "task": task,
        "prompt": prompt,
        "index": index,
        "passed": passed,
        "failure": None
        if passed
        else {"class": "PythonError", "kind": "KeyError", "world": 0, "check": None},
    }
    for index, (task, prompt, passed) in enumerate(ROWS)
)


def test_scores_by_prompt() -> None:
    b, a = task_scores(TABLE)
    assert b == TaskScore("B", (PromptScore("B", 0, 2, 2), PromptScore("B", 1, 3, 1)))
    assert a == TaskScore("A", (PromptScore("A", 0, 2, 1),))
    assert task_scores(table_of([])) == ()


def test_prompts_count_the_same_however_many_completions_they_have() -> None:
    b, a = task_scores(TABLE)
    assert b.pass_at(1) == over_prompts([1, 1 / 3])
    assert b.pass_at(2).mean == pytest.approx((1 + 2 / 3) / 2)
    assert (b.lowest(1), b.highest(1)) == (1 / 3, 1)
    assert overall([b, a], 1) == by_formula([[1, 1 / 3], [1 / 2]], over="tasks")


def test_overall_interval_is_over_tasks() -> None:
    alike = [TaskScore(name, (PromptScore(name, 0, 4, 0), PromptScore(name, 1, 4, 4))) for name in "AB"]
    passed = overall(alike, 1)
    assert passed.interval == "95% interval over tasks unknown: no variation between tasks"
    assert overall(alike[:1], 1).ends() == "unknown: too few tasks"
    apart = [*alike, *(TaskScore(name, (PromptScore(name, 0, 4, 4),)) for name in "CD")]
    assert re.fullmatch(r"95% interval over tasks 0\.\d{3} to 1\.000", overall(apart, 1).interval)
    assert alike[0].pass_at(1).over == "prompts"


def test_a_prompt_with_too_few_completions_is_refused() -> None:
    b, a = task_scores(TABLE)
    named = "^pass@3 .* 2 completions"
    for score in (b.pass_at, b.lowest, b.highest, lambda k: overall([a, b], k) if k < 3 else b.pass_at(k)):
        with pytest.raises(ValueError, match=named):
            score(3)
    with pytest.raises(ValueError, match=named):
        overall([a, b], 3)


def test_the_curve_by_hand() -> None:
    assert threshold_curve([1.0, 0.5, 0.5, 0.0]) == [(1.0, 0.25), (0.5, 0.75)]
    assert threshold_curve([0.0]) == [(1.0, 0.0)]
    assert share_at_least([0.1 + 0.2, 0.3, 0.29], 0.3) == pytest.approx(2 / 3)
    assert share_at_least([1 - 1e-12], 1.0) == 1
