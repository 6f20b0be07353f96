"""What a program that passes costs: tokens, time and money, with and without rejection sampling."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import polars as pl

from roboeval.analysis.counts import completions_of, task_scores
from roboeval.analysis.metrics import passed_count, prompts_of
from roboeval.analysis.resample import LIMITS, chances, rejected_share, requests, trials_by_prompt
from roboeval.evaluation.runs.table import MILLION, Price


class Spent(NamedTuple):
    """What completions took, in all and for each that passes; None where it was recorded of none."""

    completions: int
    passed: int
    uncounted: int  # completions without a count of tokens, such as requests that the server refused
    input_tokens: int | None
    output_tokens: int | None
    seconds: float | None
    money: float | None
    tokens_per_pass: float | None
    seconds_per_pass: float | None
    money_per_pass: float | None


def spent(table: pl.DataFrame, price: Price | None = None) -> Spent:
    """What the completions of a run took."""
    took = completions_of(table)
    passed = passed_count(prompts_of(task_scores(table)))
    there, back = _tokens(took)
    seconds = math.fsum(took["latency_s"].drop_nulls()) or None
    tokens = None if there is None or back is None else there + back
    money = None if price is None or there is None or back is None else price.of(there, back)
    each = (_per(total, passed) for total in (tokens, seconds, money))
    uncounted = took.height - _counted(took).height
    return Spent(took.height, passed, uncounted, there, back, seconds, money, *each)


def _counted(completions: pl.DataFrame) -> pl.DataFrame:
    """The tokens of completions of which they were counted."""
    return completions.select("input_tokens", "output_tokens").drop_nulls()


def _tokens(completions: pl.DataFrame) -> tuple[int, int] | tuple[None, None]:
    there, back = map(int, _counted(completions).sum().row(0))
    return (there, back) if there + back else (None, None)


class Budget(NamedTuple):
    """What a budget gives where rejected programs are asked for again."""

    retries: int
    requests: float  # for a program, on average
    per_thousand_requests: float  # programs that pass
    per_million_tokens: float | None  # None where tokens were not recorded
    per_money: float | None  # for one unit of money


def budgets(table: pl.DataFrame, price: Price | None, limits: Sequence[int] = LIMITS) -> Iterator[Budget]:
    """What a budget gives, by limit of retries (paper, section VI); all programs were checked."""
    completions, prompts = completions_of(table), trials_by_prompt(table)
    counts = pl.col("input_tokens", "output_tokens").fill_null(0)
    means = completions.group_by("task", "prompt").agg(counts.mean())
    tokens = {} if None in _tokens(completions) else {row[:2]: row[2:] for row in means.iter_rows()}
    each = [tokens.get((prompt.task, prompt.prompt), (0.0, 0.0)) for prompt in prompts]
    rejected = [rejected_share(prompt.trials) for prompt in prompts]
    for retries in limits:
        asked = [requests(share, retries) for share in rejected]
        passed = sum(chances(prompt.trials, retries).passed for prompt in prompts)
        there, back = (math.fsum(n * t[at] for n, t in zip(asked, each, strict=True)) for at in (0, 1))
        yield Budget(
            retries,
            requests=sum(asked) / len(asked),
            per_thousand_requests=1_000 * passed / sum(asked),
            per_million_tokens=_per(MILLION * passed, there + back),
            per_money=None if price is None else _per(passed, price.of(there, back)),
        )


def _per(total: float | None, count: float) -> float | None:
    return None if total is None or not count else total / count
