"""Builds the sections on rejection sampling and on the cost of passing programs (paper, section VI)."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.analysis.cost import budgets, cost_of
from roboeval.analysis.metrics import threshold_curve
from roboeval.analysis.resample import LIMITS, CheckedPrompt, accepted_after, resample
from roboeval.report.figures.curves import draw_accepted, draw_limits, most_completions
from roboeval.report.runs import JudgedRun, runs_to_draw
from roboeval.report.sheets import Cell, ReportFigure, Section, Sheet, section, sheet


def rejection_sampling(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on rejection sampling, for runs whose programs were checked."""
    checked = {run.name: run.trials for run in runs if run.trials}
    points = {name: retry_curves(prompts) for name, prompts in checked.items()}
    shares = {name: accepted_after(prompts, LIMITS[-1]) for name, prompts in checked.items()}
    steps = [[retries, *those] for retries, those in enumerate(zip(*shares.values(), strict=True))]
    drawn, left_out = runs_to_draw([run for run in runs if run.trials])
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
    """Compute, for each limit on retries, the share of prompts that reach each threshold of pass@1."""
    found = {limit: resample(prompts, limit).by_prompt for limit in LIMITS}
    return {limit: threshold_curve([one.passed for one in each]) for limit, each in found.items()}


# --- tokens, time and money


def costs(runs: Sequence[JudgedRun]) -> Section:
    """Build the section on the cost of programs, for runs that recorded it."""
    return section("cost", cost_sheet(runs), budget_sheet(runs))


def cost_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build the table of each run's cost, in total and per passing program."""
    found = [(run.name, cost_of(run.table, run.price)) for run in runs]
    known = [one for one in found if one[1].input_tokens is not None or one[1].seconds is not None]
    return sheet("cost", [[name, *one] for name, one in known])


def cost_sentence(run: JudgedRun) -> str:
    """Describe the cost per passing program. Return an empty string if no cost was recorded."""
    cost = cost_of(run.table, run.price)
    parts = (
        (cost.money_per_pass, "${:.3g}"),
        (cost.tokens_per_pass, "{:,.0f} tokens"),
        (cost.seconds_per_pass, "{:,.1f} s"),
    )
    each = [form.format(value) for value, form in parts if value is not None]
    return f"Cost per pass: {', '.join(each)}" if each else ""


def budget_sheet(runs: Sequence[JudgedRun]) -> Sheet:
    """Build a table that shows how many passing programs a budget buys, for runs with checked programs."""
    checked = [run for run in runs if run.trials]
    rows = [[run.name, *one] for run in checked for one in budgets(run.table, run.price)]
    return sheet("budget", rows)
