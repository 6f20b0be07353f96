"""Compares models that write programs with models that act: a program in a world counts as a mission, too."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

from codebotler.core.trace import Status
from roboeval.evaluation.judging.failures import (
    AGENT_ERROR_CLASS,
    NO_PROGRAM_CLASS,
    PYTHON_ERROR_CLASS,
    ROBOT_ERROR_CLASS,
    TASK_ERROR_CLASS,
)


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
