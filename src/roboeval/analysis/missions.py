"""Compares models that write programs with models that act: a program in a world counts as a mission, too."""

from __future__ import annotations

from dataclasses import dataclass

import polars as pl

from codebotler.core.errors import VIOLATION
from roboeval.analysis.counts import completions_of, task_scores
from roboeval.analysis.metrics import Estimate, TaskScore, overall


@dataclass(frozen=True)
class MissionCosts:
    """What missions took and how often they succeeded. Values that were not recorded are None."""

    mode: str  # `program`, `agent` or `replan`
    missions: int
    satisfied: Estimate  # the share that satisfied all requirements
    turns: float | None  # the mean number of replies; each program is one
    tokens: float | None  # the mean number of all turns, if each mission has its own program
    tokens_per_success: float | None
    tool_errors: float | None  # the mean number of mistakes and of errors of the robot
    forbidden: float  # the share that a house rule ended


def has_missions(table: pl.DataFrame) -> bool:
    """Whether the completions in a table are missions of an agent, each in one world."""
    return table["ending"].null_count() < table.height


def per_mission(table: pl.DataFrame) -> pl.DataFrame:
    """Return a table of a run in which each completion in each world counts as one."""
    return table.with_columns(passed=pl.col("satisfied"), world_number=pl.lit(0))


def comparable_scores(*tables: pl.DataFrame) -> list[tuple[TaskScore, ...]]:
    """Return the scores of runs: of missions, if an agent carried out those of any run."""
    if any(map(has_missions, tables)):
        tables = tuple(map(per_mission, tables))
    return [task_scores(table) for table in tables]


def mission_costs(table: pl.DataFrame) -> MissionCosts:
    """Summarise the missions of a run."""
    completions, missions = completions_of(table), per_mission(table)
    satisfied = overall(task_scores(missions), 1)
    sums = completions.select(pl.col("input_tokens") + pl.col("output_tokens"))
    tokens = _mean(sums.to_series())
    success = missions["satisfied"].mean()
    return MissionCosts(
        mode=str(completions["mode"].drop_nulls().first() or "program"),
        missions=missions.height,
        satisfied=satisfied,
        turns=_mean(completions["turns"]),
        tokens=tokens,
        tokens_per_success=tokens / float(str(success)) if tokens and success else None,
        tool_errors=_mean(completions["tool_errors"]),
        forbidden=_mean(missions["error_kind"].eq_missing(VIOLATION)) or 0.0,
    )


def _mean(values: pl.Series) -> float | None:
    known = values.drop_nulls()
    return float(known.sum()) / len(known) if len(known) else None
