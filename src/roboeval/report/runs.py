"""Prepares judged runs for a report, with unique names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import polars as pl

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import UserError
from codebotler.core.text.words import counted
from roboeval.analysis.counting.counts import completions_of, task_scores
from roboeval.analysis.metrics import TaskScore, overall, pass_at_1
from roboeval.analysis.resample import CheckedPrompt, count_by_prompt
from roboeval.evaluation.runs.results import Results
from roboeval.evaluation.runs.table import Price
from roboeval.report.figures.drawing import short_name
from roboeval.suites.load import Suite

MAX_RUN_NAME = 100
MAX_DRAWN_RUNS = 8  # readers cannot tell apart more colours


@dataclass(frozen=True, eq=False)
class JudgedRun:
    """A judged run in a report. It may also have verdicts from an ablation, another suite or house rules."""

    results: Results
    table: pl.DataFrame  # the column `accepted` is null for unchecked programs
    ablated: Results | None = None  # judged by common-sense requirements only
    other_suite: Results | None = None  # judged with another suite
    house: Results | None = None  # judged with the same suite and house rules
    name: str = ""  # unique within a report
    price: Price | None = None

    @property
    def suite(self) -> Suite:
        """The suite that judged the run."""
        return self.results.required_suite

    @property
    def folder(self) -> str:
        """The name of the run's folder."""
        return self.results.run.path.resolve().name

    @cached_property
    def is_mixed(self) -> bool:
        """Whether the completions were written by several models."""
        return self.table["model"].n_unique() > 1

    @property
    def model(self) -> str | None:
        """The model that wrote the completions, or None if it was not recorded or there are several."""
        return None if self.is_mixed else self.table["model"][0]

    @cached_property
    def completions(self) -> pl.DataFrame:
        """A table with one row for each judged completion."""
        return completions_of(self.table)

    @cached_property
    def scores(self) -> tuple[TaskScore, ...]:
        """The scores of all tasks, in the order of the suite."""
        return task_scores(self.table, self.suite.tasks)

    @cached_property
    def ablated_scores(self) -> tuple[TaskScore, ...]:
        """The scores of all tasks by common-sense requirements only. Empty if these were not judged."""
        return () if self.ablated is None else task_scores(self.ablated.table, self.suite.tasks)

    @cached_property
    def by_prompt(self) -> dict[tuple[str, int], float]:
        """The pass@1 of each prompt. The key of prompt 0 of CountMen is `("CountMen", 0)`."""
        return pass_at_1(self.scores)

    @property
    def coverage_sentence(self) -> str:
        """How much was judged, such as `12 of 80 completions (68 not judged), 5 prompts of 1 task`."""
        prompts = counted(len(self.by_prompt), "prompt")
        return f"{self.results.coverage}, {prompts} of {counted(len(self.scores), 'task')}"

    @property
    def mean(self) -> float:
        """The mean pass@1 over prompts."""
        return overall(self.scores, 1).mean

    @cached_property
    def instructions(self) -> Mapping[tuple[str, int], str]:
        """The instructions that were recorded, by task name and prompt number."""
        completions = self.results.completions.items()
        return {key[:2]: one.instruction for key, one in completions if one.instruction is not None}

    @cached_property
    def checked(self) -> tuple[CheckedPrompt, ...]:
        """The numbers of accepted and passing programs of each prompt. Empty if any is unchecked."""
        return () if self.table["accepted"].null_count() else count_by_prompt(self.table)


def tasks_of(runs: Sequence[JudgedRun]) -> list[str]:
    """Return the names of the tasks that have completions in any run, in the order of the suite."""
    judged = {score.task for run in runs for score in run.scores}
    return [task for task in dict.fromkeys([*runs[0].suite.tasks, *sorted(judged)]) if task in judged]


def runs_to_draw(runs: Sequence[JudgedRun]) -> tuple[list[JudgedRun], list[str]]:
    """Return the best runs, at most 8, and a sentence for the caption (as a list) if others are left out."""
    best = sorted(runs, key=lambda run: -run.mean)[:MAX_DRAWN_RUNS]
    left_out = [f"Only the {len(best)} best of {len(runs)} runs are shown."] if len(best) < len(runs) else []
    return [run for run in runs if run in best], left_out


def coverage_of(runs: Sequence[JudgedRun]) -> list[str]:
    """Return sentences on how much of each run was judged, or a single one if all are the same."""
    sentences: dict[str, list[str]] = {}
    for run in runs:
        sentences.setdefault(run.coverage_sentence, []).append(run.name)
    if len(sentences) == 1:
        each = "Each run: " if len(runs) > 1 else ""
        return [f"{each}{next(iter(sentences))}."]
    return [f"{', '.join(names)}: {words}." for words, names in sentences.items()]


def read_labels(texts: Sequence[str], paths: Sequence[Path]) -> dict[int, str]:
    """Parse labels such as `my=Mine`, by index in `paths`. Raise UserError if one does not fit one run."""
    labels: dict[int, str] = {}
    names = [{str(path), path.resolve().name} for path in paths]
    for text in texts:
        run, _, label = text.partition("=")
        if not run or not label.strip():
            raise UserError(f'"{text}" is not a label; write --label RUN=TEXT')
        found = [at for at, known in enumerate(names) if run.rstrip("/") in known]
        if len(found) != 1:
            which = "more than one run has this name" if found else "the report has no such run"
            raise UserError(f'--label is for "{run}", but {which}; use one of {", ".join(map(str, paths))}')
        labels[found[0]] = label.strip()
    return labels


def read_prices(texts: Sequence[str]) -> dict[str, Price]:
    """Parse prices such as `my-model=2.5/10` (input/output per million tokens). Return them by model."""
    prices: dict[str, Price] = {}
    for text in texts:
        model, _, numbers = text.rpartition("=")
        if not model:
            raise UserError(f'"{text}" names no model; write MODEL=INPUT/OUTPUT, prices per million tokens')
        prices[model] = Price.read(numbers)
    return prices


def name_runs(runs: Sequence[JudgedRun], labels: Mapping[int, str] = {}) -> list[JudgedRun]:
    """Give each run a unique name: its label (`labels` is by index in `runs`), or its model or folder."""
    given = [labels.get(at) or run.model or run.folder for at, run in enumerate(runs)]
    plain = [short_name(name, MAX_RUN_NAME) for name in given]
    with_folder = [f"{name} ({run.folder})" for name, run in zip(plain, runs, strict=True)]
    names = _extend_duplicates(plain, with_folder)
    while len({*names}) < len(names):
        names = _extend_duplicates(names, [f"{name} #{number}" for number, name in enumerate(names, 1)])
    return [replace(run, name=name) for run, name in zip(runs, names, strict=True)]


def _extend_duplicates(names: Sequence[str], longer: Sequence[str]) -> list[str]:
    counts = Counter(names)
    return [long if counts[name] > 1 else name for name, long in zip(names, longer, strict=True)]


def price_runs(runs: Sequence[JudgedRun], prices: Mapping[str, Price]) -> list[JudgedRun]:
    """Return the runs with prices, found by folder, name or model. Raise UserError if a price fits no run."""
    names = [(run.folder, run.name, run.model or "") for run in runs]
    for model in prices:
        if not any(model in those for those in names):
            known = ", ".join(run.name for run in runs)
            why = "no run has this name, model or folder"
            raise UserError(f'--price names "{model}", but {why}; use one of {known}')
    found = (next((prices[name] for name in those if name in prices), None) for those in names)
    return [replace(run, price=price) for run, price in zip(runs, found, strict=True)]
