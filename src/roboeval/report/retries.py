"""What asking again for programs that a check rejects would give (section V of the paper)."""

from __future__ import annotations

from collections.abc import Sequence

from roboeval.analysis.resample import LIMITS, CheckedPrompt, chances, resampled
from roboeval.report.reading import JudgedRun
from roboeval.report.scores import curve
from roboeval.report.sheets import Cell, Column, Sheet, sheet

ABOUT = (
    "A program that the check rejects is asked for again, at most as often as the limit says. pass@1 and its "
    "interval are over prompts;"
    " accepted is the share of programs, at the end, that the check accepts; run at "
    "all is the share that ends without an error in all the worlds of its task; at the limit is the share "
    "that is still rejected when no retry is left."
)
STEPS = range(LIMITS[-1] + 1)


def checked(runs: Sequence[JudgedRun]) -> list[tuple[str, tuple[CheckedPrompt, ...]]]:
    """The runs whose programs were checked, by name."""
    return [(run.name, run.trials) for run in runs if run.trials]


def curves(prompts: Sequence[CheckedPrompt]) -> dict[int, list[tuple[float, float]]]:
    """For each limit, the share of prompts by threshold of pass@1."""
    return {
        limit: curve([min(one.passed, 1.0) for one in resampled(prompts, limit).by_prompt])
        for limit in LIMITS
    }


def accepted(prompts: Sequence[CheckedPrompt]) -> list[float]:
    """The share of programs that the check accepts after 0, 1, ... 100 retries."""
    return [sum(chances(p.trials, n).accepted for p in prompts) / len(prompts) for n in STEPS]


def retries_sheet(runs: Sequence[JudgedRun]) -> Sheet | None:
    """What each limit gives to each run; None if no run was checked."""
    columns = [
        Column("model"),
        Column("retries", "count"),
        Column("pass@1", "share"),
        Column("low", "share"),
        Column("high", "share"),
        Column("accepted", "share"),
        Column("run at all", "share"),
        Column("at the limit", "share"),
    ]
    rows: list[list[Cell]] = [
        [name, limit, at.passed.mean, at.passed.low, at.passed.high, at.accepted, at.ran, 1 - at.accepted]
        for name, prompts in checked(runs)
        for limit in LIMITS
        for at in [resampled(prompts, limit)]
    ]
    return sheet("rejection-sampling", "Rejection sampling", columns, rows, about=ABOUT) if rows else None


def steps_sheet(runs: Sequence[JudgedRun]) -> Sheet | None:
    """The share that is accepted after each number of retries; None if no run was checked."""
    shares = [(name, accepted(prompts)) for name, prompts in checked(runs)]
    columns = [Column("retries", "count"), *(Column(name, "share") for name, _ in shares)]
    rows = [[n, *(share[n] for _, share in shares)] for n in STEPS]
    about = "The share of programs that the check accepts after at most so many retries."
    return sheet("accepted", "Accepted after retries", columns, rows, about=about) if shares else None


def curves_sheet(runs: Sequence[JudgedRun]) -> Sheet | None:
    """The curves of the fourth figure as numbers; None if no run was checked."""
    rows: list[list[Cell]] = [
        [name, limit, threshold, share]
        for name, prompts in checked(runs)
        for limit, points in curves(prompts).items()
        for threshold, share in points
    ]
    columns = [
        Column("model"),
        Column("retries", "count"),
        Column("threshold", "share"),
        Column("prompts", "share"),
    ]
    about = "The share of prompts whose pass@1 is at least the threshold, where it changes."
    return (
        sheet("rejection-sampling-curves", "Rejection sampling by threshold", columns, rows, about=about)
        if rows
        else None
    )
