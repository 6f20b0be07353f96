"""Compares verdicts under two suites, and finds how completions and the ranking of runs change."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import polars as pl

from codebotler.core.errors import UserError
from roboeval.analysis.comparisons.compare import Comparison, PromptScores, compare_scores, comparison_data
from roboeval.analysis.counting.counts import completions_of, task_scores
from roboeval.analysis.failure_groups import FailureGroup, describe_groups, group_data, group_failures
from roboeval.analysis.metrics import ROUNDING_ERROR, pass_at_1
from roboeval.evaluation.runs.completions import KEY, how_many
from roboeval.evaluation.runs.results import Results


@dataclass(frozen=True)
class TaskChanges:
    """Counts a task's completions that pass under both suites, under one of them, or under neither."""

    task: str
    both: int
    first_only: int
    second_only: int
    neither: int


@dataclass(frozen=True)
class VerdictChanges:
    """How the verdicts on a run change from one suite to another."""

    name: str
    suites: tuple[str, str]
    comparison: Comparison  # difference in pass@1, second suite minus first
    tasks: tuple[TaskChanges, ...]
    first_only: tuple[FailureGroup, ...]  # pass under the first suite, and why they fail under the second
    second_only: tuple[FailureGroup, ...]  # pass under the second suite, and why they fail under the first
    programs: int  # number of distinct programs whose verdict changes
    left_out: int  # number of completions judged with one suite only

    @property
    def completions(self) -> int:
        """The number of completions judged with both suites."""
        return sum(task.both + task.first_only + task.second_only + task.neither for task in self.tasks)

    @property
    def pass_at_1(self) -> tuple[float, float]:
        """The pass@1 under the first suite and under the second."""
        return self.comparison.first, self.comparison.second


def verdict_changes(name: str, first: Results, second: Results) -> VerdictChanges:
    """Compare a run's verdicts under two suites. Raise UserError if no completion was judged with both."""
    one, other = completions_of(first.table), completions_of(second.table)
    both = one.select(*KEY, "passed").join(other.select(*KEY, then="passed"), on=KEY).sort(KEY)
    if both.is_empty():
        raise UserError("no completion was judged with both suites; judge the run with each", file=name)
    lost = [*both.filter("passed", ~pl.col("then")).select(KEY).iter_rows()]
    won = [*both.filter("then", ~pl.col("passed")).select(KEY).iter_rows()]
    programs = first.programs
    return VerdictChanges(
        name=name,
        suites=(first.required_suite.name, second.required_suite.name),
        comparison=compare_scores(_pass_at_1(first, second), _pass_at_1(second, first)),
        tasks=tuple(_by_task(both, first.required_suite.tasks)),
        first_only=tuple(describe_groups(group_failures(map(second.row, lost), programs), second)),
        second_only=tuple(describe_groups(group_failures(map(first.row, won), programs), first)),
        programs=len({(key[0], programs[key]) for key in lost + won}),
        left_out=one.height + other.height - 2 * both.height,
    )


def _pass_at_1(results: Results, other: Results) -> PromptScores:
    """Return pass@1 of each prompt, computed from the completions that both suites have judged."""
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


# --- ranking


def ranks(found: Sequence[VerdictChanges]) -> tuple[dict[str, int], dict[str, int]]:
    """Return the rank of each run, from 1, under the first suite and under the second. Ties share a rank."""
    first, second = ({run.name: run.pass_at_1[side] for run in found} for side in (0, 1))
    return _ranked(first), _ranked(second)


def _ranked(scores: Mapping[str, float]) -> dict[str, int]:
    return {
        name: 1 + sum(other > score + ROUNDING_ERROR for other in scores.values())
        for name, score in scores.items()
    }


# --- sentences


def sentences(found: Sequence[VerdictChanges]) -> list[str]:
    """Describe how the verdicts of each run and the ranking of the runs change."""
    return [*map(describe_run, found), *describe_ranking(found), *warn_of_prompts(found)]


def describe_run(found: VerdictChanges) -> str:
    """Describe in a sentence how the verdicts of a run change."""
    first, second = found.suites
    lost, won = (sum(getattr(task, side) for task in found.tasks) for side in ("first_only", "second_only"))
    if not lost and not won:
        return f"{found.name}: {first} and {second} agree on all of {how_many(found.completions)}."
    passing = lost + sum(task.both for task in found.tasks)
    parts = []
    if lost:
        parts.append(f"rejects {lost:,} of the {how_many(passing)} that pass under {first}")
    if won:
        parts.append(f"passes {won:,} that {first} rejects")
    kinds = f"{found.programs:,} distinct program{'s' * (found.programs != 1)}"
    return f"{found.name}: {second} {' and '.join(parts)} ({kinds})."


def describe_ranking(found: Sequence[VerdictChanges]) -> list[str]:
    """Say whether the ranking changes, and how. Return an empty list for a single run."""
    if len(found) < 2:  # noqa: PLR2004 - a ranking requires two runs
        return []
    first, second = found[0].suites
    before, after = ranks(found)
    if before == after:
        return [f"The ranking of the {len(found)} runs is the same under {second} as under {first}."]
    return [f"Ranking under {first}: {_in_order(before)}; under {second}: {_in_order(after)}."]


def _in_order(places: Mapping[str, int]) -> str:
    return ", ".join(f"{place} {name}" for name, place in sorted(places.items(), key=lambda one: one[1]))


def warn_of_prompts(found: Sequence[VerdictChanges]) -> list[str]:
    """Return a warning if the runs have different prompts, or else an empty list."""
    asked = {frozenset((task.task, task.prompts) for task in one.comparison.tasks) for one in found}
    return ["The runs have different prompts, which may affect their ranking."] if len(asked) > 1 else []


# --- plain data


def changes_data(found: Sequence[VerdictChanges]) -> dict[str, Any]:
    """Convert the changes of all runs to JSON data, for `roboeval compare --suites --json`."""
    return {"suites": list(found[0].suites), "runs": [_run_data(one, found) for one in found]}


def _run_data(one: VerdictChanges, all_of_them: Sequence[VerdictChanges]) -> dict[str, Any]:
    comparison = comparison_data(one.comparison, one.suites)
    return {
        "name": one.name,
        "completions": one.completions,
        "left_out": one.left_out,
        "programs": one.programs,
        "places": [places[one.name] for places in ranks(all_of_them)],
        **{name: comparison[name] for name in ("first", "second", "difference", "interval", "p")},
        "tasks": [asdict(task) for task in one.tasks],
        "first_only": list(map(group_data, one.first_only)),
        "second_only": list(map(group_data, one.second_only)),
    }
