"""Which completions of a judged run did something: a formula tried on all their traces, on all cores."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from typing import Any

import polars as pl

from codebotler.rtl import Formula, Inconclusive, holds, parse
from roboeval.analysis.counts import completions_of
from roboeval.evaluation.processes import map_in_processes
from roboeval.evaluation.runs.completions import KEY, Key
from roboeval.evaluation.runs.rows import key_of
from roboeval.evaluation.runs.traces import can_judge, trace_of

ROWS_FOR_PROCESSES = 2_000  # rows for which other processes are worth their start


@dataclass(frozen=True)
class SearchQuery:
    """What is looked for."""

    formula: str | None = None  # of RTL; None matches every trace
    negated: bool = False  # whether it shall not hold
    task: str | None = None  # None: any
    world: str | None = None  # its number from 1, or its `about`; None: any


@dataclass(frozen=True)
class Found:
    """A completion, and the worlds, by number from 1 and name, in which it does what is looked for."""

    key: Key
    worlds: tuple[tuple[int, str], ...]
    cut: tuple[tuple[int, str], ...] = ()  # undecided: the trace was too long to be kept
    earlier: tuple[tuple[int, str], ...] = ()  # undecided: an earlier version kept no places

    @property
    def undecided(self) -> tuple[tuple[int, str], ...]:
        """The worlds in which nobody knows whether it does that."""
        return tuple(sorted((*self.cut, *self.earlier)))


def search(lines: Sequence[bytes], question: SearchQuery, *, workers: int = 1) -> Iterator[Found]:
    """Answer for rows, in their order; where there are many, in so many processes."""
    look = partial(look_through, question=question)
    if workers == 1 or len(lines) < ROWS_FOR_PROCESSES:
        return iter(look(lines))
    return map_in_processes(look, lines, workers=workers, name=lambda line: sha256(line).digest())


def looked_at(table: pl.DataFrame, task: str | None) -> int:
    """How many judged completions a question is about, of one task or of all."""
    return completions_of(table if task is None else table.filter(task=task)).height


def found_by_task(found: Sequence[Found], table: pl.DataFrame) -> pl.DataFrame:
    """How many completions of each `task` were `found`, and how many of these `passed`."""
    keys = pl.DataFrame(
        [one.key for one in found], schema={name: table.schema[name] for name in KEY}, orient="row"
    )
    verdicts = completions_of(table).select(*KEY, "passed")
    counted = keys.join(verdicts, on=KEY, how="left", maintain_order="left").group_by(
        "task", maintain_order=True
    )
    return counted.agg(found=pl.len(), passed=pl.col("passed").sum())


def look_through(lines: Sequence[bytes], question: SearchQuery) -> list[Found]:
    """Answer for some rows; the work of one process."""
    formula = None if question.formula is None else parse(question.formula)
    return [answer(json.loads(line), question, formula) for line in lines]


def answer(row: Mapping[str, Any], question: SearchQuery, formula: Formula | None) -> Found:
    """Answer for one row."""
    worlds, cut, earlier = [], [], []
    for number, verdict in _asked(row, question):
        if formula is not None and "cut" in verdict:
            cut.append((number, verdict["world"]))
        elif formula is not None and not can_judge(formula, verdict):
            earlier.append((number, verdict["world"]))
        elif formula is None or _holds(formula, verdict) != question.negated:
            worlds.append((number, verdict["world"]))
    return Found(key_of(row), tuple(worlds), tuple(cut), tuple(earlier))


def _asked(row: Mapping[str, Any], question: SearchQuery) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """The verdicts that a question is about, counted from 1."""
    if question.task not in {None, row["task"]}:
        return
    for number, verdict in enumerate(row["verdicts"], 1):
        if question.world in {None, str(number)} or verdict["world"].lower() == str(question.world).lower():
            yield number, verdict


def _holds(formula: Formula, verdict: Mapping[str, Any]) -> bool:
    try:
        return holds(formula, trace_of(verdict))
    except Inconclusive:
        return False
