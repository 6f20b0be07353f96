"""The verdicts of another suite beside those of a report: what they change, of whom, and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from roboeval.analysis.cluster import Cluster
from roboeval.analysis.verdict_changes import (
    VerdictChanges,
    place,
    said,
    said_of_order,
    said_of_prompts,
    verdict_changes,
)
from roboeval.evaluation.completions import name_of
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Cell, Column, Sheet, sheet

SCORES = (
    "pass@1 by the checks of this report and by those beside it, prompt by prompt, with the interval of the "
    "difference where prompts are drawn at random, and the place among these runs by either."
)
TASKS = "How many completions pass by both checks, by these only, by those beside only, and by neither."
GROUPS = (
    "Completions with another verdict: by which checks they pass, and what the others say against them. "
    "Those that fail alike and are similar stand together, the largest groups first."
)


def reversed_in(runs: Sequence[JudgedRun]) -> list[VerdictChanges]:
    """What the other suite changes for each run that it has judged.

    Args:
        runs: named apart.
    """
    return [verdict_changes(run.name, run.results, run.beside) for run in runs if run.beside is not None]


def sentences(found: Sequence[VerdictChanges]) -> tuple[str, ...]:
    """The changes in sentences."""
    return (*map(said, found), *said_of_order(found), *said_of_prompts(found))


def sheets(found: Sequence[VerdictChanges]) -> tuple[Sheet, ...]:
    """The changes as tables: of scores, of tasks, and of groups of completions."""
    return _scores(found), _tasks(found), _groups(found)


def _scores(found: Sequence[VerdictChanges]) -> Sheet:
    columns = (
        Column("model"),
        Column("pass@1", "share"),
        Column("pass@1 beside", "share"),
        Column("difference", "difference"),
        Column("prompts: low", "difference"),
        Column("prompts: high", "difference"),
        Column("place", "count"),
        Column("place beside", "count"),
    )
    here, there = ({one.name: one.pass_at_1[side] for one in found} for side in (0, 1))
    rows: list[list[Cell]] = []
    for one in found:
        before, after = one.pass_at_1
        over = one.comparison.over_prompts
        places = place(one.name, here), place(one.name, there)
        rows.append([one.name, before, after, after - before, over.low, over.high, *places])
    return sheet("beside", "Beside other checks", columns, rows, about=SCORES)


def _tasks(found: Sequence[VerdictChanges]) -> Sheet:
    counts = ("both", "here only", "beside only", "neither")
    columns = (Column("task"), Column("model"), *(Column(head, "count") for head in counts))
    rows: list[list[Cell]] = [
        [task.task, one.name, task.both, task.first_only, task.second_only, task.neither]
        for one in found
        for task in one.tasks
    ]
    return sheet("beside-tasks", "Beside other checks, by task", columns, rows, about=TASKS)


def _groups(found: Sequence[VerdictChanges]) -> Sheet:
    heads = ("task", "class", "kind", "check", "why", "such as")
    columns = (Column("model"), Column("passes"), Column("completions", "count"), *map(Column, heads))
    every = {one.name: [*_rows(one)] for one in found}
    rows = [row for those in every.values() for row in those[:MOST]]
    notes = [
        f"{name}: {len(those) - MOST:,} smaller groups are left out; `roboeval compare --suites` shows them."
        for name, those in every.items()
        if len(those) > MOST
    ]
    title = "What passes by one of the checks only"
    return sheet("reversals", title, columns, rows, about=GROUPS, notes=notes)


MOST = 100  # groups of each run


def _rows(one: VerdictChanges) -> Iterator[list[Cell]]:
    """A row for each group, the largest first."""
    yield from sorted(_both_ways(one), key=lambda row: -row[2])


def _both_ways(one: VerdictChanges) -> Iterator[list[Any]]:
    sides: Iterable[tuple[str, Sequence[Cluster]]] = (
        (f"{one.suites[0]} only", one.first_only),
        (f"{one.suites[1]} only", one.second_only),
    )
    for passes, groups in sides:
        for group in groups:
            failure = group.failure
            ground = [failure["class"], failure["kind"], failure["check"], group.why]
            size, example = len(group.members), name_of(group.representative)
            yield [one.name, passes, size, group.task, *ground, example]
