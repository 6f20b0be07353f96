"""The costs of completions, and the passes that a budget buys."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import polars as pl
import pytest

from made_up_runs import UNCHECKED, new_run
from roboeval.analysis.resample import mean_requests
from roboeval.evaluation.runs.table import Price
from roboeval.report.runs import JudgedRun
from roboeval.report.sections.cost import budgets, cost_of


def usage(there: float, back: float, seconds: float) -> Mapping[str, Any]:
    return {"usage": {"input_tokens": there, "output_tokens": back}, "latency_s": seconds}


def priced_run(price: Price | None = None, **about: Any) -> JudgedRun:  # noqa: ANN401 - the options of new_run
    about.setdefault("written", lambda *_: usage(1_000, 500, 2.0))
    return replace(new_run("a", about.pop("passes", {"Visit": (4,)}), **about), price=price)


def test_cost_by_hand() -> None:
    found = cost_of(priced_run(Price(10.0, 20.0)))
    assert (found.completions, found.passed) == (10, 4)
    assert (found.input_tokens, found.output_tokens, found.seconds) == (10_000, 5_000, 20.0)
    assert found.money == pytest.approx(0.1 + 0.1)
    assert found.tokens_per_pass == pytest.approx(15_000 / 4)
    assert found.seconds_per_pass == pytest.approx(20.0 / 4)
    assert found.money_per_pass == pytest.approx(0.05)


def test_without_a_pass_there_is_no_cost_per_pass() -> None:
    found = cost_of(priced_run(Price(10.0, 20.0), passes={"Visit": (0,)}))
    assert found.money == pytest.approx(0.2)
    assert found.tokens_per_pass is found.money_per_pass is None


def test_unrecorded_costs_are_unknown() -> None:
    nothing = cost_of(priced_run(Price(1, 1), written=lambda *_: {}))
    assert (nothing.uncounted, set(nothing[3:])) == (10, {None})
    zeros = cost_of(priced_run(Price(1, 1), written=lambda *_: usage(0, 0, 0.0)))
    assert (zeros.uncounted, set(zeros[3:])) == (0, {None})


def test_refused_requests_add_nothing_and_are_counted() -> None:
    half = cost_of(priced_run(Price(1, 1), written=lambda _, index: usage(1, 1, 1.0) if index else {}))
    assert (half.uncounted, half.input_tokens, half.output_tokens, half.seconds) == (1, 9, 9, 9.0)


def test_sums_do_not_depend_on_the_order_of_completions() -> None:
    run = priced_run(written=lambda _, index: usage(1, 1, 0.1 * index))
    assert cost_of(run) == cost_of(replace(run, table=run.table.reverse()))
    assert cost_of(run).seconds == math.fsum(0.1 * index for index in range(10))


def test_requests_by_hand() -> None:
    assert mean_requests(1 / 2, 0) == 1
    assert mean_requests(1 / 2, 2) == 1 + 1 / 2 + 1 / 4
    assert mean_requests(1, 4) == 5
    assert mean_requests(0, 100) == 1


def test_a_budget_by_hand() -> None:
    run = priced_run(Price(10.0, 20.0), passes={"Visit": (5,)}, accepted=pl.col("passed"))
    found = {one.retries: one for one in budgets(run)}
    assert found[0].per_thousand_requests == pytest.approx(500)
    assert found[2].requests == pytest.approx(1.75)
    assert found[2].per_thousand_requests == pytest.approx(1_000 * 0.875 / 1.75)
    assert found[0].per_million_tokens == pytest.approx(0.5 * 1e6 / 1_500)
    assert found[0].per_money == pytest.approx(0.5 / 0.02)
    assert {one.per_money for one in budgets(replace(run, price=None))} == {None}


def test_money_depends_on_the_requests_of_each_prompt() -> None:
    run = priced_run(
        Price(1.0, 100.0),
        passes={"Visit": (1, 0)},
        of=1,
        accepted=pl.col("passed"),
        written=lambda prompt, _: usage(0, 1_000, 1.0) if prompt else usage(1_000, 0, 1.0),
    )
    found = {one.retries: one for one in budgets(run)}
    # The first prompt takes one request, and the second three, with expensive output.
    assert found[2].per_money == pytest.approx(1 / (0.001 + 3 * 0.1))


def test_unjudged_completions_cost_nothing() -> None:
    both = priced_run(passes={"Visit": (4,), "FindBook": (4,)}, accepted=UNCHECKED)
    assert cost_of(replace(both, table=both.table.filter(pl.col("task") == "Visit"))) == cost_of(priced_run())


@pytest.mark.parametrize("much", [10**400, 10**13, float("inf"), float("nan"), -1, True, "x", None])
def test_impossible_counts_are_ignored(much: object) -> None:
    said = {"usage": {"input_tokens": much, "output_tokens": 1}, "latency_s": much}
    run = priced_run(Price(1, 1), passes={"Visit": (1,)}, written=lambda *_: said)
    table = run.table
    assert set(table["input_tokens"]) == set(table["latency_s"]) == {None}
    assert set(table["output_tokens"]) == {1}
    assert cost_of(run).tokens_per_pass is None


def test_malformed_usage_is_ignored() -> None:
    run = new_run("a", {"Visit": (1,)}, written=lambda *_: {"usage": 3, "latency_s": 1.5})
    assert set(run.table["output_tokens"]) == {None}
    assert cost_of(run).seconds == 15.0
