"""Results made of rows that a test writes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl

from codebotler.core.errors import RobotError
from codebotler.core.files import to_line
from codebotler.core.trace import Event, Trace
from codebotler.core.world import World
from codebotler.simulator.worlds.robot import SimulatedRobot
from roboeval.evaluation.judging.serialization import row_line
from roboeval.evaluation.runs.completions import Completion, CompletionKey
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.rows import Row, decode_row, key_of
from roboeval.evaluation.runs.table import TableBuilder
from roboeval.suites.load import Suite

VERDICT = {
    "world": "w",
    "satisfied": True,
    "status": "finished",
    "error": None,
    "line": None,
    "failed_checks": [],
    "trace": [],
    "places": [],
}


def judged_rows(rows: Iterable[Mapping[str, Any]], programs: Mapping[CompletionKey, str] = {}) -> list[Row]:
    """Decode rows, with defaults for the fields that a test omits."""
    return [decode_row(to_line(_complete(row, programs.get(key_of(row), "")))) for row in rows]


def row_of(completion: Completion, judgement: bytes) -> Row:
    """Return the row of an evaluation as it is read."""
    row: Row = json.loads(row_line(completion, judgement))
    return row


def _complete(row: Mapping[str, Any], program: str) -> dict[str, Any]:
    failure = row.get("failure")
    least = 1 if failure is None else failure["world"] + 1
    verdicts = [{**VERDICT, **verdict} for verdict in row.get("verdicts", ())]
    verdicts += [{**VERDICT, "satisfied": failure is None}] * (least - len(verdicts))
    made = Completion(task="T", prompt=0, index=0, program=program).program_sha256
    return {"program_sha256": made, **row, "failure": failure, "verdicts": verdicts}


def with_places(world: World, *events: Event) -> Trace:
    """Return events with the places where they happen, as the drives among them determine."""
    robot, driven = SimulatedRobot(world), []
    for event in events:
        if event.kind == "goto":
            with suppress(RobotError):
                robot.drive(event.text)
            driven.append(robot.events[-1])
        else:
            driven.append(replace(event, place=robot.room))
    return tuple(driven)


def table_of(rows: Iterable[Mapping[str, Any]]) -> pl.DataFrame:
    """Build the table of some rows."""
    builder = TableBuilder()
    for row in judged_rows(rows):
        builder.add(row)
    return builder.table()


@dataclass(frozen=True, eq=False, kw_only=True)
class InMemoryResults(Results):
    """Results without a file."""

    rows: Mapping[CompletionKey, Row]

    def row(self, key: CompletionKey) -> Row:
        return self.rows[key]


def results_of(
    rows: Iterable[Mapping[str, Any]],
    suite: Suite | None = None,
    programs: Mapping[CompletionKey, str] = {},
    *,
    completions: Iterable[Completion] = (),
    ablated: bool = False,
    head: Mapping[str, Any] = {},
) -> Results:
    """Return the results of rows as if they had been read from a run.

    Args:
        rows: the rows of the evaluation.
        suite: the suite that judged them.
        programs: the judged programs; that of any other completion is empty.
        completions: the judged completions, if they need more fields.
        ablated: whether only common sense was required.
        head: the content of KEY.json.
    """
    written = {one.key: one for one in completions}
    for (task, prompt, index), program in programs.items():
        written[task, prompt, index] = Completion(task=task, prompt=prompt, index=index, program=program)
    rows = list(rows)
    for task, prompt, index in map(key_of, rows):
        if (task, prompt, index) not in written:
            none = Completion(task=task, prompt=prompt, index=index, program="")
            written[none.key] = none
    judged = judged_rows(rows, {key: one.program for key, one in written.items()})
    builder = TableBuilder()
    for row in judged:
        builder.add(row, written[key_of(row)])
    return InMemoryResults(
        run=RunFolder(Path("nowhere")),
        key=f"paper{'-ablation' * ablated}",
        suite=suite,
        manifest=head,
        about={},
        completions=written,
        table=builder.table(),
        places={key_of(row): (0, 0) for row in judged},
        rows={key_of(row): row for row in judged},
    )
