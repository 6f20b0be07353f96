"""Searches the traces of a judged run for a formula."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from codebotler.rtl import Formula, Inconclusive, holds
from roboeval.evaluation.runs.completions import CompletionKey
from roboeval.evaluation.runs.rows import key_of
from roboeval.evaluation.runs.traces import trace_of


@dataclass(frozen=True)
class TraceQuery:
    """A search for traces by task, world and formula. If `negated`, traces must violate the formula."""

    formula: Formula | None = None  # None matches every trace
    negated: bool = False  # whether to find traces that do not satisfy the formula
    task: str | None = None  # None matches any task
    world: str | None = None  # number (from 1) or `about` of a world; None matches any world


@dataclass(frozen=True)
class TraceMatch:
    """The worlds in which a completion matches a query, each with its number (from 1) and name."""

    key: CompletionKey
    worlds: tuple[tuple[int, str], ...]
    cut: tuple[tuple[int, str], ...] = ()  # worlds whose trace was too long to be stored
    is_in_scope: bool = True  # whether it was judged in a world of the query


def search_row(row: Mapping[str, Any], query: TraceQuery) -> TraceMatch:
    """Return in which worlds a completion matches a query, and in which its trace is too long to tell."""
    formula = query.formula
    worlds, cut = [], []
    verdicts = [*_verdicts_in_scope(row, query)]
    for number, verdict in verdicts:
        if formula is not None and "cut" in verdict:
            cut.append((number, verdict["world"]))
        elif formula is None or _holds(formula, verdict) != query.negated:
            worlds.append((number, verdict["world"]))
    return TraceMatch(key_of(row), tuple(worlds), tuple(cut), bool(verdicts))


def _verdicts_in_scope(row: Mapping[str, Any], query: TraceQuery) -> Iterator[tuple[int, Mapping[str, Any]]]:
    if query.task not in {None, row["task"]}:
        return
    for number, verdict in enumerate(row["verdicts"], 1 + row.get("mission_world", 0)):
        if query.world in {None, str(number)} or verdict["world"].lower() == str(query.world).lower():
            yield number, verdict


def _holds(formula: Formula, verdict: Mapping[str, Any]) -> bool:
    try:
        return holds(formula, trace_of(verdict))
    except Inconclusive:
        return False
