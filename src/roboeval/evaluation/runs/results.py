"""Loads a judged run as one table with a row per completion and world, from which statistics are computed."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import polars as pl

from codebotler.core.cachedproperty import cached_property
from codebotler.core.errors import UserError
from roboeval.evaluation.generating.requests import requested_tasks
from roboeval.evaluation.runs.completions import Completion, CompletionKey
from roboeval.evaluation.runs.folder import (
    RunFolder,
    about_of,
    evaluation_of,
    load_json_object,
    selected_tasks,
)
from roboeval.evaluation.runs.rows import LocatedRow, Row, key_of, read_checks, read_lines_of, take_judged
from roboeval.evaluation.runs.scope import Coverage, JudgingScope
from roboeval.evaluation.runs.table import Price, TableBuilder, keys_where, with_answers, with_cost
from roboeval.suites.load import ABLATED, Suite, load_suite

REPLACED = "was replaced by another process; try again"


def load_results(
    run: str | PathLike[str],
    suite: str | PathLike[str] = "paper",
    *,
    ablation: bool = False,
    price: tuple[float, float] | None = None,
) -> pl.DataFrame:
    """Read the verdicts of a judged run as one table with a row for each completion and world.

    Args:
        run: the folder of the run.
        suite: the name or folder of the suite that judged it.
        ablation: whether to read the verdicts of the ablation, which requires only common sense.
        price: the prices of a million input and output tokens, for the column `cost`.

    Returns:
        A table sorted by completion and world. These columns repeat in all rows of a completion: `task`,
        `prompt`, `index`, `model`, `program_sha256`, `passed`, the first failure (`failure_class`,
        `failure_kind`, `failure_world`, `failure_check`), `instruction`, `program`, `no_program`,
        `finish_reason`, `cut_off`, `input_tokens`, `output_tokens`, `reasoning_tokens`, `latency_s`, `mode`,
        `ending`, `mission_world`, `turns`, `tool_errors`, `cost` and `accepted` (whether the check found no
        problem; null if the program was not checked). These columns describe a world: `world_number`,
        `world`, `satisfied`, `status`, `error_kind`, `error_message`, `line`, `failed_checks` (joined by
        "; "), `category` (of the first failed check) and `events`. Prompts, indexes and worlds count from 0.

    Raises:
        UserError: the run or suite does not exist, the suite has not judged the run, a file is damaged, or
            a program has changed since it was judged.
    """
    table = read_results(*evaluation_of(Path(run), load_suite(suite), ablated=ablation)).table
    return table if price is None else with_cost(table, Price(*price))


@dataclass(frozen=True, eq=False, kw_only=True)
class Results:
    """One evaluation of a run: its completions, its table of verdicts, and what run.json and KEY.json say."""

    run: RunFolder
    key: str | None  # the name of the evaluation, such as `plus`; None if the run has not been judged
    suite: Suite | None  # the suite that judged, or None if it is not available
    manifest: Mapping[str, Any]  # the content of KEY.json
    about: Mapping[str, Any]  # the content of run.json
    completions: Mapping[CompletionKey, Completion]  # all completions in the run, in order
    # The offset and size of each row in the file, in bytes.
    places: Mapping[CompletionKey, tuple[int, int]] = field(repr=False)
    table: pl.DataFrame  # the table that `load_results` returns

    @cached_property
    def passed(self) -> Sequence[CompletionKey]:
        """Return the keys of the completions that passed."""
        return keys_where(self.table, pl.col("passed"))

    @cached_property
    def failed(self) -> Sequence[CompletionKey]:
        """Return the keys of the completions that failed."""
        return keys_where(self.table, ~pl.col("passed"))

    @property
    def required_suite(self) -> Suite:
        """The suite that judged the run. It must have been given when the results were read."""
        assert self.suite is not None, "only web pages show runs without their suite"
        return self.suite

    @property
    def tasks(self) -> frozenset[str] | None:
        """Return the tasks that were selected for the evaluation or requested since, or None for all."""
        selected, requested = selected_tasks(self.manifest), requested_tasks(self.about)
        if self.is_ablated or selected is None:
            return selected
        return None if requested is None else selected | requested

    @cached_property
    def scope(self) -> JudgingScope:
        """The numbers of completions that should be judged, by task and by how they ended."""
        return JudgingScope.of(self.completions.values(), self.tasks, self.about, self.suite)

    @property
    def coverage(self) -> Coverage:
        """Return the numbers of judged, existing and requested completions."""
        return self.scope.coverage(len(self.places))

    @property
    def is_ablated(self) -> bool:
        """Whether the evaluation required only common sense."""
        return (self.key or "").endswith(ABLATED)

    @property
    def programs(self) -> Mapping[CompletionKey, str]:
        """The source of each program, by the key of its completion."""
        return {key: completion.program for key, completion in self.completions.items()}

    def row(self, key: CompletionKey) -> Row:
        """Read the row of a completion with all its traces. Raise UserError if the file has been replaced."""
        at, size = self.places[key]
        path = self.run.rows(self.key or "")
        try:
            with path.open("rb") as file:
                file.seek(at)
                row: Row = json.loads(file.read(size))
            if key_of(row) == key:
                return row
        except (OSError, ValueError, LookupError, TypeError, RecursionError):
            pass
        raise UserError(REPLACED, file=path)


ShowProgress: TypeAlias = Callable[[Iterator[LocatedRow], int], Iterable[LocatedRow]]
"""A function that passes rows through and shows progress. The second argument is the number of rows."""


def read_results(
    run: RunFolder,
    key: str | None,
    suite: Suite | None = None,
    *,
    task: str | None = None,
    reuse_from: Results | None = None,
    progress: ShowProgress = lambda lines, _: lines,
) -> Results:
    """Read an evaluation of a run, with its completions and verdicts.

    Args:
        run: the run.
        key: the name of the evaluation, or None if the run has not been judged.
        suite: the suite that judged the run, or None if it is not available.
        task: the only task whose rows are read; by default, all tasks are read.
        reuse_from: another evaluation of the same run whose completions can be reused.
        progress: a function that yields the given rows and shows progress; it also gets their number.
    """
    if reuse_from:
        about, completions = reuse_from.about, reuse_from.completions
    else:
        about, completions = about_of(run), _read_completions(run)
    manifest = {} if key is None else load_json_object(run.manifest(key))
    selected = selected_tasks(manifest) if task is None else {task}
    total = sum(selected is None or name in selected for name, _, _ in completions)
    builder, left = TableBuilder(_categories(suite)), dict(completions)
    places: dict[CompletionKey, tuple[int, int]] = {}
    rows = run.rows(key or "")
    lines = iter(()) if key is None else read_lines_of(rows, manifest, task=task)
    for line in progress(lines, total):
        builder.add(line.row, take_judged(left, line, rows))
        places[key_of(line.row)] = line.at, line.size
    checks = run.checks((key or "").removesuffix(ABLATED))
    problems = dict(read_checks(checks)) if checks.is_file() else {}
    return Results(
        run=run,
        key=key,
        suite=suite,
        manifest=manifest,
        about=about,
        completions=completions,
        places=places,
        table=with_answers(builder.table(), problems) if problems else builder.table(),
    )


def _categories(suite: Suite | None) -> Mapping[tuple[str, str], str]:
    tasks = () if suite is None else suite.tasks.values()
    return {
        (task.name, requirement.text): requirement.category
        for task in tasks
        for scenario in (*task.scenarios, *(task.ablation or ()))
        for requirement in scenario.require
    }


def _read_completions(run: RunFolder) -> dict[CompletionKey, Completion]:
    if not run.completions.exists() or not run.completions.stat().st_size:  # a run that has just begun
        return {}
    return {(sys.intern(one.task), one.prompt, one.index): one for one in run.read()}
