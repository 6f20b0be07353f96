"""Compares models that write programs with models that act: a program in a world counts as a mission, too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import polars as pl

from codebotler.core.errors import VIOLATION
from codebotler.core.trace import Status
from roboeval.analysis.counting.counts import completions_of, task_scores
from roboeval.analysis.metrics import Estimate, overall
from roboeval.evaluation.judging.failures import (
    AGENT_ERROR_CLASS,
    NO_PROGRAM_CLASS,
    PYTHON_ERROR_CLASS,
    ROBOT_ERROR_CLASS,
    TASK_ERROR_CLASS,
)
from roboeval.evaluation.runs.endings import OUTSIDE_CONTRACT


@dataclass(frozen=True)
class MissionCosts:
    """The success rate and the costs of missions. Values that were not recorded are None."""

    mode: str  # `program`, `agent` or `replan`
    missions: int
    satisfied: Estimate  # the share that satisfied all requirements
    turns: float | None  # the mean number of replies; each program is one
    tokens: float | None  # the mean number of all turns, if each mission has its own program
    tokens_per_success: float | None
    tool_errors: float | None  # the mean number of mistakes and of errors of the robot
    forbidden: float  # the share that a house rule or a contract ended


def has_missions(table: pl.DataFrame) -> bool:
    """Whether the completions in a table are missions of an agent, each in one world."""
    return table["ending"].null_count() < table.height


def per_mission(table: pl.DataFrame) -> pl.DataFrame:
    """Return a table of a run in which each completion in each world counts as one, with its own failure."""
    kept = pl.col("failure_class").is_in([NO_PROGRAM_CLASS, AGENT_ERROR_CLASS])
    is_check = pl.col("failed_checks").is_not_null()
    is_robots = pl.col("status") == Status.ROBOT_ERROR.value
    of_world = (
        pl.when(is_check).then(pl.lit(TASK_ERROR_CLASS)).when(is_robots).then(pl.lit(ROBOT_ERROR_CLASS))
    )
    kind = pl.when(is_check).then("category").otherwise("error_kind")
    failed = pl.when(~pl.col("satisfied"))
    return table.with_columns(
        passed=pl.col("satisfied"),
        world_number=pl.lit(0),
        failure_class=failed.then(
            pl.when(kept).then("failure_class").otherwise(of_world.otherwise(pl.lit(PYTHON_ERROR_CLASS)))
        ),
        failure_kind=failed.then(pl.when(kept).then("failure_kind").otherwise(kind)),
    )


def comparable_tables(*tables: pl.DataFrame) -> Sequence[pl.DataFrame]:
    """Return the tables of runs: of missions, if an agent carried out those of any run."""
    return [*map(per_mission, tables)] if any(map(has_missions, tables)) else tables


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
        forbidden=_mean(missions["error_kind"].is_in([VIOLATION, OUTSIDE_CONTRACT]).fill_null(value=False))
        or 0.0,
    )


def _mean(values: pl.Series) -> float | None:
    known = values.drop_nulls()
    return float(known.sum()) / len(known) if len(known) else None
