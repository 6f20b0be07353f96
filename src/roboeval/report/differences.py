"""Which of several runs is better, pair by pair."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from codebotler.badinput import BadInput
from roboeval.analysis.compare import compared, told_of, unlike, verdict
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Cell, Column, Sheet, sheet

MOST_PAIRS = 10  # beyond which each run is compared with the best only
ABOUT = (
    "The second run minus the first, paired by prompt, with 95 % intervals where prompts and where tasks are "
    "drawn at random. p is how often chance alone gives a difference as large. The last two columns say how "
    "many completions of each prompt, or how many prompts like these, would tell a difference of this size "
    "four times in five."
)
MANY = "Of twenty pairs that do not differ at all, one has a p below 0.05 by chance."


def difference_sheet(runs: Sequence[JudgedRun]) -> tuple[Sheet, list[str]] | None:
    """All pairs as a table and in sentences; None if there is only one run."""
    rows: list[list[Cell]] = []
    said: list[str] = []
    unequal: list[str] = []
    for first, second in _pairs(runs):
        try:
            found = compared(first.by_prompt, second.by_prompt)
        except BadInput:  # no prompt in common
            continue
        if len(said) < MOST_PAIRS:
            said.append(verdict(found, (first.name, second.name)))
            unequal += _unlike(first, second)
        over = found.over_prompts, found.over_tasks
        ends = [end for estimate in over for end in (estimate.low, estimate.high)]
        much = found.needed
        name = f"{second.name} minus {first.name}"
        ps = found.p_prompts, found.p_tasks
        rows.append([name, found.prompts, over[0].mean, *ends, *ps, much.completions, much.prompts])
    columns = (
        Column("pair"),
        Column("prompts", "count"),
        Column("difference", "difference"),
        Column("prompts: low", "difference"),
        Column("prompts: high", "difference"),
        Column("tasks: low", "difference"),
        Column("tasks: high", "difference"),
        Column("p over prompts", "number"),
        Column("p over tasks", "number"),
        Column("completions to tell", "count"),
        Column("prompts to tell", "count"),
    )
    if not rows:
        return None
    notes = [*([MANY] if len(rows) > 1 else []), *unequal]
    return sheet("differences", "Differences", columns, rows, about=ABOUT, notes=notes), said


def _unlike(first: JudgedRun, second: JudgedRun) -> list[str]:
    found = unlike(*(told_of(run.results.about, run.results.head) for run in (first, second)))
    return [f"{first.name} and {second.name}: {'; '.join(found)}."] if found else []


def _pairs(runs: Sequence[JudgedRun]) -> list[tuple[JudgedRun, JudgedRun]]:
    pairs = list(combinations(runs, 2))
    if len(pairs) <= MOST_PAIRS:
        return pairs
    best = max(runs, key=lambda run: sum(run.by_prompt.values()) / len(run.by_prompt))
    return [(run, best) for run in runs if run is not best]
