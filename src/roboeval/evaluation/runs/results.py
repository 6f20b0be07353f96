"""A judged run as one table: a row for each completion and world, from which all numbers are counted."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

import msgspec
import polars as pl

from codebotler.core.errors import UserError
from roboeval.evaluation.requests import requested_tasks
from roboeval.evaluation.runs.completions import Completion, CompletionKey, read_completions
from roboeval.evaluation.runs.folder import RunFolder, evaluation_of, load_head, selected_tasks
from roboeval.evaluation.runs.rows import LocatedRow, Row, add_or_raise, key_of, read_checks, read_lines_of
from roboeval.evaluation.runs.scope import JudgingScope
from roboeval.evaluation.runs.table import Price, TableBuilder, keys_where, with_cost
from roboeval.evaluation.runs.traces import without_trace
from roboeval.suites.load import ABLATED, Suite, load_suite


def load_results(
    run: str | PathLike[str],
    suite: str | PathLike[str] = "paper",
    *,
    ablation: bool = False,
    price: tuple[float, float] | None = None,
) -> pl.DataFrame:
    """The verdicts of a judged run as one table, with a row for each completion and world.

    Args:
        run: the folder of the run.
        suite: by which it was judged: a name, or a folder.
        ablation: whether to take the verdicts on common sense only.
        price: of a million tokens of input and of output, from which `cost` is reckoned.

    Returns:
        a table in the order of the completions and of the worlds of their tasks. `task`, `prompt`, `index`,
        `model`, `program_sha256`, `passed`, the failure (`failure_class`, `failure_kind`, `failure_world`,
        `failure_check`: the first failure of the completion), `stale` (whether another program stands in the
        run by now; then `instruction`, `program`, `no_program`, `finish_reason` and `cut_off` are null),
        `input_tokens`, `output_tokens`, `reasoning_tokens`, `latency_s`, `cost` and `accepted` (whether the
        check found no problem; null where nobody checked) are the same in all rows of a completion;
        `world_number`, `world`, `satisfied`, `status`, `error_kind`, `error_message`, `line`,
        `failed_checks` (joined by "; "), `category` (of the first failed check) and `events` are about the
        world. Numbers count from 0.

    Raises:
        UserError: there is no such run or suite, the suite has not judged it, or one of its files is damaged.
    """
    known = load_suite(suite)
    table = read_results(*evaluation_of(Path(run), known, ablated=ablation), keep_failed=False).table
    return table if price is None else with_cost(table, Price(*price))


@dataclass(frozen=True, eq=False, kw_only=True)
class Results:
    """One evaluation of a run, with its table."""

    run: RunFolder
    key: str | None
    suite: Suite | None  # None if it is not at hand
    head: Mapping[str, Any]  # KEY.json: by what was judged
    about: Mapping[str, Any]  # run.json: how the completions were asked for
    completions: Mapping[CompletionKey, Completion]  # those in the run now, in order
    places: Mapping[CompletionKey, tuple[int, int]] = field(
        repr=False
    )  # first byte and size of each row in the file
    passed: Sequence[CompletionKey] = field(repr=False)
    stale: Sequence[CompletionKey]  # whose verdicts are on other programs than stand in the run now
    table: pl.DataFrame  # as `load_results` gives it
    failed: Mapping[CompletionKey, bytes] = field(repr=False)  # rows as JSON, see `failed_row`
    faults: tuple[UserError, ...] = ()

    @property
    def known_suite(self) -> Suite:
        """Its suite, where it was read with one."""
        assert self.suite is not None, "only pages show runs whose suite is not at hand"
        return self.suite

    @property
    def tasks(self) -> frozenset[str] | None:
        """The tasks that were selected, and those that were requested since; None for all."""
        selected, requested = selected_tasks(self.head), requested_tasks(self.about)
        if self.is_ablated or selected is None:
            return selected
        return None if requested is None else selected | requested

    @property
    def scope(self) -> JudgingScope:
        """What there is to judge."""
        return JudgingScope.of(self.completions.values(), self.tasks, self.about, self.suite)

    @property
    def is_ablated(self) -> bool:
        """Whether common sense only was required."""
        return (self.key or "").endswith(ABLATED)

    @property
    def programs(self) -> Mapping[CompletionKey, str]:
        """The programs that were judged, but those that have changed or are gone since."""
        stale = set(self.stale)
        return {key: c.program for key, c in self.completions.items() if key not in stale}

    def row(self, key: CompletionKey) -> Row:
        """Read a row again, with all its traces; raises UserError if the file was written anew."""
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
        raise UserError("was replaced meanwhile; try again", file=path)

    def failed_row(self, key: CompletionKey) -> Row:
        """The row of a completion that failed, without traces of worlds that did not decide."""
        row: Row = json.loads(self.failed[key])
        return row


ShowProgress: TypeAlias = Callable[
    [Iterator[LocatedRow], int], Iterable[LocatedRow]
]  # passes rows on; gets their number


def no_progress(lines: Iterator[LocatedRow], _total: int) -> Iterable[LocatedRow]:
    """Pass lines on."""
    return lines


def read_results(
    run: RunFolder,
    key: str | None,
    suite: Suite | None = None,
    *,
    reuse_from: Results | None = None,  # another evaluation of the same run, whose completions are taken over
    keep_failed: bool = True,  # may take much memory
    faults: list[UserError] | None = None,
    on_line: Callable[[bytes], None] | None = None,  # gets the line of each row
    progress: ShowProgress = no_progress,
) -> Results:
    """Read an evaluation of a run, each file once; what is wrong is added to `faults`, or else raised."""
    about, completions = (
        (reuse_from.about, reuse_from.completions) if reuse_from else read_written(run, faults)
    )
    builder = TableBuilder(completions, _categories(suite), _accepted(run, key, faults))
    failed: dict[CompletionKey, bytes] = {}

    def add(row: Row) -> None:
        builder.add(row)
        if keep_failed and row["failure"] is not None:
            failed[key_of(row)] = without_other_traces(row, row["failure"]["world"])

    head, places = read_rows(run, key, completions, add, faults=faults, on_line=on_line, progress=progress)
    table = builder.table()
    return Results(
        run=run,
        key=key,
        suite=suite,
        head=head,
        about=about,
        completions=completions,
        places=places,
        passed=keys_where(table, "passed"),
        stale=keys_where(table, "stale"),
        faults=tuple(faults or ()),
        table=table,
        failed=failed,
    )


def without_other_traces(row: Row, world: int) -> bytes:
    """A row as JSON, with the trace of one world only: a run may fail often, with long traces."""
    verdicts = [
        verdict if number == world else without_trace(verdict)
        for number, verdict in enumerate(row["verdicts"])
    ]
    return msgspec.json.encode({**row, "verdicts": verdicts})


def _categories(suite: Suite | None) -> Mapping[tuple[str, str], str]:
    """The category of each requirement, by its task and its text."""
    tasks = () if suite is None else suite.tasks.values()
    return {
        (task.name, requirement.text): requirement.category
        for task in tasks
        for scenario in (*task.scenarios, *(task.ablation or ()))
        for requirement in scenario.require
    }


def _accepted(
    run: RunFolder, key: str | None, faults: list[UserError] | None
) -> Mapping[tuple[str, str], bool]:
    """Whether the check found no problem, by task and hash of the program, where it was asked."""
    path = run.checks((key or "").removesuffix(ABLATED))
    accepted: dict[tuple[str, str], bool] = {}
    if not path.is_file():
        return accepted
    try:
        accepted |= {program: not problems for program, problems in read_checks(path)}
    except UserError as error:
        add_or_raise(error, faults)
    return accepted


def read_rows(
    run: RunFolder,
    key: str | None,
    completions: Iterable[CompletionKey],
    add: Callable[[Row], None],
    *,
    faults: list[UserError] | None = None,
    on_line: Callable[[bytes], None] | None = None,
    progress: ShowProgress = no_progress,
) -> tuple[Mapping[str, Any], Mapping[CompletionKey, tuple[int, int]]]:
    """Add each row of an evaluation; return its head, and where each row is in the file."""
    head = {} if key is None else _head(run.head(key), faults)
    tasks = selected_tasks(head)
    total = sum(tasks is None or task in tasks for task, _, _ in completions)
    places: dict[CompletionKey, tuple[int, int]] = {}
    lines = iter(()) if key is None else read_lines_of(run.rows(key), head, on_line=on_line, faults=faults)
    for line in progress(lines, total):
        add(line.row)
        places[key_of(line.row)] = line.at, line.size
    return head, places


def read_written(
    run: RunFolder, faults: list[UserError] | None
) -> tuple[Mapping[str, Any], Mapping[CompletionKey, Completion]]:
    """How a run's completions were asked for, and they themselves."""
    about = _head(run.about, faults) if run.about.exists() else {}
    completions = read_completions(run.completions, growing=True, faults=faults)
    return about, {(sys.intern(one.task), one.prompt, one.index): one for one in completions}


def _head(path: Path, faults: list[UserError] | None) -> Mapping[str, Any]:
    try:
        return load_head(path)
    except UserError as error:
        add_or_raise(error, faults)
        return {}
