"""Computes the cost per passing program in tokens, time and money."""

from __future__ import annotations

import math
from typing import NamedTuple

import polars as pl

from roboeval.analysis.counts import completions_of
from roboeval.evaluation.runs.table import Price


class RunCost(NamedTuple):
    """The cost of completions in total and per passing program. Values that were not recorded are None."""

    completions: int
    passed: int
    uncounted: int  # completions without token counts, such as refused requests
    input_tokens: int | None
    output_tokens: int | None
    seconds: float | None
    money: float | None
    tokens_per_pass: float | None
    seconds_per_pass: float | None
    money_per_pass: float | None


def cost_of(table: pl.DataFrame, price: Price | None = None) -> RunCost:
    """Compute the cost of the completions of a run."""
    completions = completions_of(table)
    passed = int(completions["passed"].sum())
    counted = completions.select("input_tokens", "output_tokens").drop_nulls()
    sent, received = map(int, counted.sum().row(0))
    tokens = sent + received or None
    seconds = math.fsum(completions["latency_s"].drop_nulls()) or None
    money = None if price is None or tokens is None else price.of(sent, received)
    each = (_per(total, passed) for total in (tokens, seconds, money))
    uncounted = completions.height - counted.height
    known = [count if tokens else None for count in (sent, received)]
    return RunCost(completions.height, passed, uncounted, known[0], known[1], seconds, money, *each)


def _per(total: float | None, count: float) -> float | None:
    return None if total is None or not count else total / count
