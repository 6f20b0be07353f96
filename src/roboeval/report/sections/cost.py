"""Builds the sections on rejection sampling and on the cost of passing programs (paper, section VI)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import polars as pl

from roboeval.analysis.metrics import threshold_curve
from roboeval.analysis.resample import (
    LIMITS,
    CheckedPrompt,
    accepted_after,
    final_chances,
    mean_requests,
    resample,
)
from roboeval.evaluation.runs.table import MILLION
from roboeval.report.figures.curves import draw_accepted, draw_limits, most_completions
from roboeval.report.runs import JudgedRun, runs_to_draw
from roboeval.report.sheets import Cell, ReportFigure, Section, Sheet, section, sheet


def rejection_sampling_section(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on rejection sampling: asking the model again until the check accepts a program."""
    checked = {run.name: run.checked for run in runs if run.checked}
    points = {name: retry_curves(prompts) for name, prompts in checked.items()}
    shares = {name: accepted_after(prompts, LIMITS[-1]) for name, prompts in checked.items()}
    steps = [[retries, *those] for retries, those in enumerate(zip(*shares.values(), strict=True))]
    drawn, left_out = runs_to_draw([run for run in runs if run.checked])
    curves = {run.name: points[run.name] for run in drawn}
    lines = {run.name: shares[run.name] for run in drawn}
    retries: list[list[Cell]] = []
    for name, prompts in checked.items():
        for at in (resample(prompts, limit) for limit in LIMITS):
            passed = at.passed.mean, at.passed.low, at.passed.high
            retries.append([name, at.retries, *passed, at.accepted, at.ran, 1 - at.accepted])
    thresholds = [
        [name, limit, *point]
        for name, of_limits in points.items()
        for limit, curve in of_limits.items()
        for point in curve
    ]
    parts = (
        ReportFigure("rejection-sampling", lambda: draw_limits(curves, most_completions(runs)), left_out),
        sheet("rejection-sampling", retries),
        ReportFigure("accepted", lambda: draw_accepted(lines), left_out),
        sheet("rejection-sampling-curves", thresholds),
        sheet("accepted", steps, shares=[*shares]),
    )
    return section("rejection-sampling", *(parts if checked else ()))


def retry_curves(prompts: Sequence[CheckedPrompt]) -> dict[int, list[tuple[float, float]]]:
    """Return a curve for each limit on retries: pairs of a pass@1 and the share of prompts that reach it."""
    found = {limit: resample(prompts, limit).by_prompt for limit in LIMITS}
    return {limit: threshold_curve([one.passed for one in each]) for limit, each in found.items()}


# --- tokens, time and money


class RunCost(NamedTuple):
    """The tokens, seconds and money that a run's completions took. Values that were not recorded are None."""

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


def cost_of(run: JudgedRun) -> RunCost:
    """Add up the tokens, seconds and money that completions took, in total and per passing completion."""
    completions, price = run.completions, run.price
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


def cost_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of each run's cost, in total and per passing program. Omit runs of unknown cost."""
    found = [(run.name, cost_of(run)) for run in runs]
    known = [one for one in found if one[1].input_tokens is not None or one[1].seconds is not None]
    return sheet("cost", [[name, *one] for name, one in known])


def cost_sentence(run: JudgedRun) -> str:
    """Return a text such as `Cost per pass: 2,729 tokens, 1.1 s`. It is empty if no cost was recorded."""
    cost = cost_of(run)
    parts = (
        (cost.money_per_pass, "${:.3g}"),
        (cost.tokens_per_pass, "{:,.0f} tokens"),
        (cost.seconds_per_pass, "{:,.1f} s"),
    )
    each = [form.format(value) for value, form in parts if value is not None]
    return f"Cost per pass: {', '.join(each)}" if each else ""


class Budget(NamedTuple):
    """The number of passing programs per request, token and unit of money, for one limit on retries."""

    retries: int
    requests: float  # mean number per program
    per_thousand_requests: float  # number of passing programs
    per_million_tokens: float | None  # number of passing programs, or None if tokens were not recorded
    per_money: float | None  # number of passing programs per unit of money, or None if unknown


def budgets(run: JudgedRun) -> Iterator[Budget]:
    """Yield a budget for each limit on retries (paper, section VI). All programs must have been checked."""
    completions, prompts, price = run.completions, run.checked, run.price
    counts = pl.col("input_tokens", "output_tokens").fill_null(0)
    means = completions.group_by("task", "prompt").agg(counts.mean())
    tokens = {} if None in _tokens(completions) else {row[:2]: row[2:] for row in means.iter_rows()}
    each = [tokens.get((prompt.task, prompt.prompt), (0.0, 0.0)) for prompt in prompts]
    for retries in LIMITS:
        asked = [mean_requests(prompt.rejected, retries) for prompt in prompts]
        passed = sum(final_chances(prompt, retries).passed for prompt in prompts)
        sent, received = (math.fsum(n * t[at] for n, t in zip(asked, each, strict=True)) for at in (0, 1))
        yield Budget(
            retries,
            requests=sum(asked) / len(asked),
            per_thousand_requests=1_000 * passed / sum(asked),
            per_million_tokens=_per(MILLION * passed, sent + received),
            per_money=None if price is None else _per(passed, price.of(sent, received)),
        )


def budget_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build a table that shows how many passing programs a budget buys, for runs with checked programs."""
    return sheet("budget", [[run.name, *one] for run in runs if run.checked for one in budgets(run)])


def _per(total: float | None, count: float) -> float | None:
    return None if total is None or not count else total / count
