"""Which abilities a model lacks, and whether its programs come back to report (section V.B of the paper)."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

from codebotler.simulator.robot import resolve_room
from roboeval.analysis.statistics import by_formula
from roboeval.analysis.summary import failures
from roboeval.evaluation.failures import PYTHON, ROBOT, TASK
from roboeval.evaluation.rows import RowData
from roboeval.report.reading import JudgedRun
from roboeval.report.sheets import Cell, Column, Sheet, sheet
from roboeval.suites.load import Suite

REPORTS = "report-back"
LOST = "GoToInvalidLocation"
WITH_REPORT = "come back and report"
MOST_SENTENCES = 20
ABILITIES = (
    "A task takes several abilities, so a completion counts in several rows. pass@1 is the mean over "
    "prompts, with the 95 % interval over tasks; the rest are shares of completions that fail by each class."
)
COMES_BACK = (
    "Tasks in which the robot must come back and report, beside the others. Of the failures: how many left "
    "the room where they started and never went back to it, and how many went to a room that does not exist; "
    "one failure may be both."
)


def ability_sheet(runs: Sequence[JudgedRun], suite: Suite) -> Sheet | None:
    """pass@1 and causes by the abilities that tasks take; None if the suite names none."""
    abilities = list(dict.fromkeys(a for task in suite.tasks.values() for a in task.abilities))
    rows = [row for ability in abilities for run in runs if (row := _ability_row(ability, run, suite))]
    columns = (
        Column("ability"),
        Column("model"),
        Column("tasks", "count"),
        Column("pass@1", "share"),
        Column("tasks: low", "share"),
        Column("tasks: high", "share"),
        Column("Python errors", "share"),
        Column("robot errors", "share"),
        Column("failed checks", "share"),
    )
    return sheet("abilities", "pass@1 by ability", columns, rows, about=ABILITIES) if rows else None


def _ability_row(ability: str, run: JudgedRun, suite: Suite) -> list[Cell] | None:
    tasks = {name for name, task in suite.tasks.items() if ability in task.abilities}
    values = [values for task, values in run.by_task.items() if task in tasks]
    if not values:
        return None
    at = by_formula(values)
    causes = {one.name: one.share for one in failures(run.table.filter(pl.col("task").is_in(tasks)))}
    shares = [causes[name] for name in (PYTHON, ROBOT, TASK)]
    return [ability, run.name, len(values), at.mean, at.low, at.high, *shares]


def coming_back_sheet(runs: Sequence[JudgedRun], suite: Suite) -> Sheet | None:
    """Tasks with a report against those without; None if the suite has none with a report."""
    back = {name for name, task in suite.tasks.items() if REPORTS in task.abilities}
    rows: list[list[Cell]] = []
    for run in runs:
        for what, is_back in ((WITH_REPORT, True), ("others", False)):
            those = run.completions.filter(pl.col("task").is_in(back) == is_back)
            if those.height:
                rows.append([run.name, what, *_coming_back(those, run, suite)])
    columns = (
        Column("model"),
        Column("tasks"),
        Column("completions", "count"),
        Column("pass@1", "share"),
        Column("failed", "count"),
        Column("never returned", "count"),
        Column("share never returned", "share"),
        Column("no such room", "count"),
        Column("share no such room", "share"),
    )
    found = sheet("coming-back", "Coming back", columns, rows, about=COMES_BACK)
    return found if back and rows else None


def _coming_back(completions: pl.DataFrame, run: JudgedRun, suite: Suite) -> list[Cell]:
    tasks = {*completions["task"]}
    values = [value for task, values in run.by_task.items() if task in tasks for value in values]
    failed = [row for row in run.results.failed.values() if row["task"] in tasks]
    away = sum(never_returned(row, suite) for row in failed)
    lost = sum(row["failure"]["kind"] == LOST for row in failed)
    shares = [count / len(failed) if failed else None for count in (away, lost)]
    return [completions.height, sum(values) / len(values), len(failed), away, shares[0], lost, shares[1]]


def coming_back_said(table: Sheet) -> list[str]:
    """The same in sentences, for tasks that end with a report.

    Args:
        table: as `coming_back_sheet` makes it.
    """
    heads = [column.head for column in table.columns]
    found = [dict(zip(heads, row, strict=True)) for row in table.rows]
    return [
        f"Of {row['failed']:,} failures of {row['model']} in tasks that end with a report, "
        f"{row['never returned']:,} left and never came back, and {row['no such room']:,} went to a room "
        "that does not exist."
        for row in found[:MOST_SENTENCES]
        if row["tasks"] == WITH_REPORT and row["failed"]
    ]


def never_returned(row: RowData, suite: Suite) -> bool:
    """Whether, in the world that decided, the robot left the room where it started and never went back.

    Args:
        row: of a completion that failed, as `trimmed` leaves it.
        suite: whose worlds have the rooms; where it has the world no more, the answer is no, as it is where
            the trace was too long to be kept.
    """
    task = suite.tasks.get(row["task"])
    number = row["failure"]["world"]
    scenarios = () if task is None else task.scenarios
    if number >= len(scenarios) or "cut" in row["verdicts"][number]:
        return False
    world = scenarios[number].world
    rooms = [room.name for room in world.rooms]
    drives = [text for kind, text, *_ in row["verdicts"][number]["trace"] if kind == "goto"]
    goals = [resolve_room(rooms, text) for text in drives]
    visited = [goal for goal in goals if goal is not None]
    left = next((at for at, goal in enumerate(visited) if goal != world.robot), None)
    return left is not None and world.robot not in visited[left:]
