"""What a program that passes costs: tokens, time and money, with and without rejection sampling."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import polars as pl

from codebotler.badinput import BadInput
from roboeval.analysis.resample import LIMITS, CheckedPrompt, chances
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Cell, Column, Sheet, sheet

MILLION = 1_000_000
ABOUT = (
    "Sums over the completions that were judged. Tokens and time are left out where a run does not tell them "
    "of each of its completions. Money is in the unit of the prices that were given with --price."
)
BUDGET = (
    "How many requests a program takes on average where rejected ones are asked for again, and how many "
    "programs that pass come of 1,000 requests, of a million tokens and of one unit of money. What a check "
    "costs is not counted: it takes milliseconds, and no tokens."
)


@dataclass(frozen=True)
class Price:
    """What a model costs.

    Args:
        model: the name of the run's model, or of its folder.
        input: of a million tokens of input.
        output: of a million tokens of output.
    """

    model: str
    input: float
    output: float


def price_from(text: str) -> Price:
    """Read `MODEL=INPUT/OUTPUT`.

    Raises:
        BadInput: it is none.
    """
    model, _, numbers = text.rpartition("=")
    try:
        there, back = map(float, numbers.split("/"))
    except ValueError:
        there = back = -1.0
    if not model or not 0 <= there < MILLION or not 0 <= back < MILLION:
        raise BadInput(f'"{text}" is no price; write MODEL=INPUT/OUTPUT, of a million tokens each')
    return Price(model, there, back)


@dataclass(frozen=True)
class Spent:
    """What some completions took; None where nobody counted."""

    completions: int
    passed: int
    input_tokens: int | None
    output_tokens: int | None
    seconds: float | None

    def money(self, price: Price | None) -> float | None:
        """What they cost."""
        if price is None or self.input_tokens is None or self.output_tokens is None:
            return None
        return (self.input_tokens * price.input + self.output_tokens * price.output) / MILLION

    @property
    def tokens(self) -> int | None:
        """Both kinds together."""
        both = self.input_tokens, self.output_tokens
        return None if None in both else sum(n for n in both if n is not None)


def spent(run: JudgedRun) -> Spent:
    """What the completions of a run took, as far as it says so of each."""
    took = run.completions
    tokens = took.select("input_tokens", "output_tokens")
    is_counted = not any(tokens.null_count().row(0)) and any(tokens.sum().row(0))
    timed = took["latency_s"]
    is_timed = not timed.null_count() and bool(timed.sum())
    return Spent(
        completions=took.height,
        passed=int(took["passed"].sum()),
        input_tokens=int(tokens["input_tokens"].sum()) if is_counted else None,
        output_tokens=int(tokens["output_tokens"].sum()) if is_counted else None,
        seconds=math.fsum(timed) if is_timed else None,
    )


def price_of(run: JudgedRun, prices: Iterable[Price]) -> Price | None:
    """The price that was given for a run: that for its folder, or else that for its model."""
    given = {price.model: price for price in prices}
    return given.get(run.folder) or given.get(run.name) or given.get(run.model or "")


def expect_known(prices: Sequence[Price], runs: Sequence[JudgedRun]) -> None:
    """Refuse a price of what is not there, and two prices of the same.

    Raises:
        BadInput: no run has the model or the name, or it is named twice.
    """
    for number, price in enumerate(prices):
        if price.model in {other.model for other in prices[:number]}:
            raise BadInput(f'--price names "{price.model}" twice; give one price')
        if not any(price_of(run, [price]) for run in runs):
            names = ", ".join(run.name for run in runs)
            raise BadInput(f'--price names "{price.model}", but the runs are {names}')


def cost_sheet(runs: Sequence[JudgedRun], prices: Sequence[Price]) -> Sheet | None:
    """What each run took, and what each of its programs that pass; None if no run says it."""
    rows: list[list[Cell]] = []
    for run in runs:
        took = spent(run)
        money = took.money(price_of(run, prices))
        if took.tokens is not None or took.seconds is not None:
            sums = [took.input_tokens, took.output_tokens, took.seconds, money]
            each = [_per(total, took.passed) for total in (took.tokens, took.seconds, money)]
            rows.append([run.name, took.completions, took.passed, *sums, *each])
    columns = (
        Column("model"),
        Column("completions", "count"),
        Column("passed", "count"),
        Column("input tokens", "count"),
        Column("output tokens", "count"),
        Column("seconds", "number"),
        Column("money", "number"),
        Column("tokens per pass", "number"),
        Column("seconds per pass", "number"),
        Column("money per pass", "number"),
    )
    return sheet("cost", "What a program that passes costs", columns, rows, about=ABOUT) if rows else None


def _per(total: float | None, count: float) -> float | None:
    return None if total is None or not count else total / count


def requests(prompt: CheckedPrompt, retries: int) -> float:
    """How many requests a program of a prompt takes on average: until one is accepted, or none is left.

    Args:
        prompt: its completions, checked.
        retries: how often a rejected one is asked for again.
    """
    rejected = sum(not trial.accepted for trial in prompt.trials) / len(prompt.trials)
    return sum(rejected**n for n in range(retries + 1))


def budget_sheet(runs: Sequence[JudgedRun], prices: Sequence[Price]) -> Sheet | None:
    """What a budget gives at each limit of retries; None if no run was checked."""
    rows: list[list[Cell]] = []
    for run in runs:
        tokens = _of_a_request(run) if spent(run).tokens is not None else {}
        price = price_of(run, prices)
        rows += [
            [run.name, limit, *_budget_cells(run.trials, limit, tokens, price)]
            for limit in LIMITS
            if run.trials
        ]
    columns = (
        Column("model"),
        Column("retries", "count"),
        Column("requests per program", "number"),
        Column("passes per 1,000 requests", "number"),
        Column("passes per million tokens", "number"),
        Column("passes per unit of money", "number"),
    )
    return sheet("budget", "What a budget gives", columns, rows, about=BUDGET) if rows else None


def _budget_cells(
    prompts: Sequence[CheckedPrompt],
    limit: int,
    tokens: Mapping[tuple[str, int], tuple[float, float]],
    price: Price | None,
) -> list[Cell]:
    asked = [requests(prompt, limit) for prompt in prompts]
    passed = sum(chances(prompt.trials, limit).passed for prompt in prompts)
    each = [tokens.get((prompt.task, prompt.prompt), (0.0, 0.0)) for prompt in prompts]
    there, back = (math.fsum(n * t[at] for n, t in zip(asked, each, strict=True)) for at in (0, 1))
    paid = 0.0 if price is None else there * price.input + back * price.output
    return [
        sum(asked) / len(asked),
        1_000 * passed / sum(asked),
        _per(MILLION * passed, there + back),
        _per(MILLION * passed, paid),
    ]


def _of_a_request(run: JudgedRun) -> Mapping[tuple[str, int], tuple[float, float]]:
    """The mean numbers of tokens of input and of output, by prompt."""
    means = run.completions.group_by("task", "prompt").agg(pl.col("input_tokens", "output_tokens").mean())
    return {(task, prompt): (there, back) for task, prompt, there, back in means.iter_rows()}
