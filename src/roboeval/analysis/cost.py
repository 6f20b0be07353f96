"""Computes the cost per passing program in tokens, time and money, with and without rejection sampling."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import polars as pl

from roboeval.analysis.counting.counts import completions_of
from roboeval.analysis.resample import LIMITS, final_chances, mean_requests, rejected_share, trials_by_prompt
from roboeval.evaluation.runs.table import MILLION, Price


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
    sent, received = _tokens(completions)
    seconds = math.fsum(completions["latency_s"].drop_nulls()) or None
    tokens = None if sent is None or received is None else sent + received
    money = None if price is None or sent is None or received is None else price.of(sent, received)
    each = (_per(total, passed) for total in (tokens, seconds, money))
    uncounted = completions.height - _counted(completions).height
    return RunCost(completions.height, passed, uncounted, sent, received, seconds, money, *each)


def _counted(completions: pl.DataFrame) -> pl.DataFrame:
    return completions.select("input_tokens", "output_tokens").drop_nulls()


def _tokens(completions: pl.DataFrame) -> tuple[int, int] | tuple[None, None]:
    sent, received = map(int, _counted(completions).sum().row(0))
    return (sent, received) if sent + received else (None, None)


class Budget(NamedTuple):
    """The number of passing programs that a budget yields with rejection sampling."""

    retries: int
    requests: float  # mean number per program
    per_thousand_requests: float  # number of passing programs
    per_million_tokens: float | None  # number of passing programs, or None if tokens were not recorded
    per_money: float | None  # number of passing programs per unit of money, or None if unknown


def budgets(table: pl.DataFrame, price: Price | None, limits: Sequence[int] = LIMITS) -> Iterator[Budget]:
    """Yield a budget for each limit on retries (paper, section VI). All programs must have been checked."""
    completions, prompts = completions_of(table), trials_by_prompt(table)
    counts = pl.col("input_tokens", "output_tokens").fill_null(0)
    means = completions.group_by("task", "prompt").agg(counts.mean())
    tokens = {} if None in _tokens(completions) else {row[:2]: row[2:] for row in means.iter_rows()}
    each = [tokens.get((prompt.task, prompt.prompt), (0.0, 0.0)) for prompt in prompts]
    rejected = [rejected_share(prompt.trials) for prompt in prompts]
    for retries in limits:
        asked = [mean_requests(share, retries) for share in rejected]
        passed = sum(final_chances(prompt.trials, retries).passed for prompt in prompts)
        sent, received = (math.fsum(n * t[at] for n, t in zip(asked, each, strict=True)) for at in (0, 1))
        yield Budget(
            retries,
            requests=sum(asked) / len(asked),
            per_thousand_requests=1_000 * passed / sum(asked),
            per_million_tokens=_per(MILLION * passed, sent + received),
            per_money=None if price is None else _per(passed, price.of(sent, received)),
        )


def _per(total: float | None, count: float) -> float | None:
    return None if total is None or not count else total / count
