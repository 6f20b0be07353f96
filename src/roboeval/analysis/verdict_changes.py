"""Verdicts under two suites compared: which completions change, and whether the ranking of models does."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import polars as pl

from codebotler.core.errors import UserError
from roboeval.analysis.cluster import Cluster, cluster_data, clusters, groups
from roboeval.analysis.compare import Comparison, PromptScores, compared, comparison_data
from roboeval.analysis.counts import completions_of, task_scores
from roboeval.analysis.metrics import pass_at_1
from roboeval.analysis.statistics import ROUNDING
from roboeval.evaluation.runs.completions import KEY, how_many
from roboeval.evaluation.runs.results import Results


@dataclass(frozen=True)
class TaskChanges:
    """How many completions of a task pass under which of two suites."""

    task: str
    both: int
    first_only: int
    second_only: int
    neither: int


@dataclass(frozen=True)
class VerdictChanges:
    """What a second suite changes for one run."""

    name: str
    suites: tuple[str, str]
    comparison: Comparison  # the second suite minus the first
    tasks: tuple[TaskChanges, ...]  # in the order of the first suite
    first_only: tuple[Cluster, ...]  # what passes so, with what the second says against it
    second_only: tuple[Cluster, ...]  # with what the first says against it
    programs: int  # different ones with another verdict
    left_out: int  # completions that only one suite has judged

    @property
    def completions(self) -> int:
        """How many both suites have judged."""
        return sum(task.both + task.first_only + task.second_only + task.neither for task in self.tasks)

    @property
    def pass_at_1(self) -> tuple[float, float]:
        """Under the first suite, and under the second."""
        return self.comparison.first, self.comparison.second


def verdict_changes(name: str, first: Results, second: Results) -> VerdictChanges:
    """Find the completions whose verdicts differ; raises UserError if none was judged by both."""
    one, other = completions_of(first.table), completions_of(second.table)
    both = one.select(*KEY, "passed").join(other.select(*KEY, then="passed"), on=KEY).sort(KEY)
    if both.is_empty():
        raise UserError("no completion was judged by both suites", file=name)
    lost = [*both.filter("passed", ~pl.col("then")).select(KEY).iter_rows()]
    won = [*both.filter("then", ~pl.col("passed")).select(KEY).iter_rows()]
    programs = first.programs
    return VerdictChanges(
        name=name,
        suites=(first.known_suite.name, second.known_suite.name),
        comparison=compared(_pass_at_1(first, second), _pass_at_1(second, first)),
        tasks=tuple(_by_task(both, first.known_suite.tasks)),
        first_only=tuple(clusters(groups(map(second.failed_row, lost), programs), second)),
        second_only=tuple(clusters(groups(map(first.failed_row, won), programs), first)),
        programs=len({(key[0], programs.get(key)) for key in lost + won}),
        left_out=one.height + other.height - 2 * both.height,
    )


def _pass_at_1(results: Results, other: Results) -> PromptScores:
    """pass@1 of each prompt, of the completions that were judged in the other results as well."""
    return pass_at_1(task_scores(results.table.join(other.table.select(KEY).unique(), on=KEY, how="semi")))


def _by_task(both: pl.DataFrame, order: Iterable[str]) -> Iterator[TaskChanges]:
    first, second = pl.col("passed"), pl.col("then")
    counted = both.group_by("task", maintain_order=True).agg(
        both=(first & second).sum(),
        first_only=(first & ~second).sum(),
        second_only=(~first & second).sum(),
        neither=(~first & ~second).sum(),
    )
    changes = {row["task"]: TaskChanges(**row) for row in counted.iter_rows(named=True)}
    return (changes[task] for task in dict.fromkeys([*order, *changes]) if task in changes)


# --- the order of models


def place(name: str, scores: Mapping[str, float]) -> int:
    """The place of a run, from 1; those that pass equally often share one."""
    return 1 + sum(score > scores[name] + ROUNDING for score in scores.values())


@dataclass(frozen=True)
class Overtaking:
    """Two runs that two suites put in another order, or tie under one only."""

    one: str  # better under the second suite, or else under the first
    other: str
    first: float  # by how much it passes more often under the first suite
    second: float  # and under the second


def overtakings(found: Sequence[VerdictChanges]) -> list[Overtaking]:
    """All pairs of runs that the suites put in another order, or of which one suite only has a tie."""
    pairs = (_overtaking(one, other) for one, other in combinations(found, 2))
    return [told for told in pairs if _sign(told.first) != _sign(told.second)]


def _overtaking(one: VerdictChanges, other: VerdictChanges) -> Overtaking:
    first, second = (a - b for a, b in zip(one.pass_at_1, other.pass_at_1, strict=True))
    if (_sign(second), _sign(first)) < (0, 0):
        return Overtaking(other.name, one.name, -first, -second)
    return Overtaking(one.name, other.name, first, second)


def _sign(difference: float) -> int:
    return (difference > ROUNDING) - (difference < -ROUNDING)


# --- in sentences


def sentences(found: Sequence[VerdictChanges]) -> list[str]:
    """What changes for each run, and for the order of all."""
    return [*map(said, found), *said_of_order(found), *said_of_prompts(found)]


def said(found: VerdictChanges) -> str:
    """What changes for a run, in a sentence."""
    first, second = found.suites
    lost, won = (sum(getattr(task, side) for task in found.tasks) for side in ("first_only", "second_only"))
    if not lost and not won:
        return f"{found.name}: {first} and {second} agree on all of {how_many(found.completions)}."
    passing = lost + sum(task.both for task in found.tasks)
    told = []
    if lost:
        told.append(f"rejects {lost:,} of the {how_many(passing)} that pass under {first}")
    if won:
        told.append(f"passes {won:,} that {first} rejects")
    kinds = f"{found.programs:,} different program{'s' * (found.programs != 1)}"
    return f"{found.name}: {second} {' and '.join(told)} ({kinds})."


def said_of_order(found: Sequence[VerdictChanges]) -> list[str]:
    """Whether models change places, in sentences; of one run alone, none."""
    if len(found) < 2:  # noqa: PLR2004 - an order takes two
        return []
    first, second = found[0].suites
    changes = overtakings(found)
    if not changes:
        return [f"The order of the {len(found)} runs is the same under {second} as under {first}."]
    return [
        f"{pair.one} passes {HOW_OFTEN[_sign(pair.second)]} {pair.other} under {second}, "
        f"and {HOW_OFTEN[_sign(pair.first)]} it under {first}."
        for pair in changes
    ]


HOW_OFTEN = {1: "more often than", 0: "as often as", -1: "less often than"}


def said_of_prompts(found: Sequence[VerdictChanges]) -> list[str]:
    """A warning where runs are about different prompts."""
    asked = {frozenset((task.task, task.prompts) for task in one.comparison.tasks) for one in found}
    warning = "The runs have different prompts, which may affect their order."
    return [warning] if len(asked) > 1 else []


# --- for machines


def changes_data(found: Sequence[VerdictChanges]) -> dict[str, Any]:
    """What a second suite changes, as plain data."""
    first, second = found[0].suites
    return {
        "suites": [first, second],
        "runs": [_run_data(one, found) for one in found],
        "overtakings": [asdict(one) for one in overtakings(found)],
    }


def _run_data(one: VerdictChanges, all_of_them: Sequence[VerdictChanges]) -> dict[str, Any]:
    scores = [{run.name: run.pass_at_1[side] for run in all_of_them} for side in (0, 1)]
    compared = comparison_data(one.comparison, one.suites)
    return {
        "name": one.name,
        "completions": one.completions,
        "left_out": one.left_out,
        "programs": one.programs,
        "places": [place(one.name, of) for of in scores],
        **{name: compared[name] for name in ("first", "second", "difference", "interval", "p")},
        "tasks": [asdict(task) for task in one.tasks],
        "first_only": list(map(cluster_data, one.first_only)),
        "second_only": list(map(cluster_data, one.second_only)),
    }
