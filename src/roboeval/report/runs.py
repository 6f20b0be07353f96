"""Judged runs as a report shows them, under names that tell them apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import polars as pl

from codebotler.core.cachedproperty import cached_property
from roboeval.analysis.counts import completions_of, task_scores
from roboeval.analysis.metrics import TaskScore, overall, pass_at_1
from roboeval.analysis.resample import CheckedPrompt, trials_by_prompt
from roboeval.evaluation.runs.results import Results
from roboeval.report.drawing import short_name
from roboeval.suites.load import Suite

LONGEST_NAME = 100


@dataclass(frozen=True, eq=False)
class JudgedRun:
    """A run with its verdicts."""

    results: Results
    table: pl.DataFrame  # `accepted` is null where programs were not checked
    ablated: Results | None = None  # where common sense only was judged
    beside: Results | None = None  # as another suite judges it
    house: Results | None = None  # as the same suite judges it with house rules
    name: str = ""  # in figures and tables; no two runs of a report share it

    @property
    def suite(self) -> Suite:
        """The suite that judged it."""
        return self.results.known_suite

    @property
    def folder(self) -> str:
        """The name of its folder."""
        return self.results.run.path.resolve().name

    @cached_property
    def is_mixed(self) -> bool:
        """Whether several models wrote the completions."""
        return self.table["model"].n_unique() > 1

    @property
    def model(self) -> str | None:
        """The model that wrote the completions; None if not recorded, or if several did."""
        return None if self.is_mixed else self.table["model"][0]

    @cached_property
    def completions(self) -> pl.DataFrame:
        """One row for each judged completion."""
        return completions_of(self.table)

    @cached_property
    def scores(self) -> tuple[TaskScore, ...]:
        """The scores of tasks, in the order of the suite."""
        return task_scores(self.table, self.suite.tasks)

    @cached_property
    def ablated_scores(self) -> tuple[TaskScore, ...]:
        """The scores of tasks by common sense only."""
        return () if self.ablated is None else task_scores(self.ablated.table, self.suite.tasks)

    @cached_property
    def by_prompt(self) -> dict[tuple[str, int], float]:
        """pass@1 of each prompt."""
        return pass_at_1(self.scores)

    @property
    def mean(self) -> float:
        """The mean pass@1 over prompts."""
        return overall(self.scores, 1).mean

    @cached_property
    def instructions(self) -> Mapping[tuple[str, int], str]:
        """The instruction of each prompt, where it was recorded."""
        completions = self.results.completions.items()
        return {key[:2]: one.instruction for key, one in completions if one.instruction is not None}

    @cached_property
    def trials(self) -> tuple[CheckedPrompt, ...]:
        """The checked completions by prompt; none where not all were checked."""
        return () if self.table["accepted"].null_count() else trials_by_prompt(self.table)


def tasks_of(runs: Sequence[JudgedRun]) -> list[str]:
    """The tasks with completions in any run, in the order of the suite."""
    there = {score.task for run in runs for score in run.scores}
    return [task for task in dict.fromkeys([*runs[0].suite.tasks, *sorted(there)]) if task in there]


def named_apart(runs: Sequence[JudgedRun]) -> list[JudgedRun]:
    """The same runs, each named by its model and, where that is not unique, by its folder, too."""
    plain = [short_name(run.model or run.folder, LONGEST_NAME) for run in runs]
    names = _apart(plain, [f"{name} ({run.folder})" for name, run in zip(plain, runs, strict=True)])
    while len({*names}) < len(names):
        names = _apart(names, [f"{name} #{number}" for number, name in enumerate(names, 1)])
    return [replace(run, name=name) for run, name in zip(runs, names, strict=True)]


def _apart(names: Sequence[str], longer: Sequence[str]) -> list[str]:
    counts = Counter(names)
    return [long if counts[name] > 1 else name for name, long in zip(names, longer, strict=True)]
