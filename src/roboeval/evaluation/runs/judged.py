"""A judged run without its table, for those who look at single completions."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from codebotler.core.errors import UserError
from roboeval.evaluation.requests import requested_tasks
from roboeval.evaluation.runs.completions import Completion, Key, read_completions
from roboeval.evaluation.runs.folder import Run, load_head
from roboeval.evaluation.runs.rows import LocatedRow, Row, add_or_raise, key_of, read_lines_of
from roboeval.evaluation.runs.scope import Scope
from roboeval.suites.load import ABLATED, Suite


@dataclass(frozen=True, eq=False, kw_only=True)
class RunEvaluation:
    """One evaluation of a run, without its table."""

    run: Run
    key: str | None
    suite: Suite | None  # None if it is not at hand
    head: Mapping[str, Any]  # KEY.json: by what was judged
    about: Mapping[str, Any]  # run.json: how the completions were asked for
    completions: Mapping[Key, Completion]  # those in the run now, in order
    places: Mapping[Key, tuple[int, int]] = field(repr=False)  # first byte and size of each row in the file
    passed: Sequence[Key] = field(repr=False)
    stale: Sequence[Key]  # whose verdicts are on other programs than stand in the run now
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
    def scope(self) -> Scope:
        """What there is to judge."""
        return Scope.of(self.completions.values(), self.tasks, self.about, self.suite)

    @property
    def is_ablated(self) -> bool:
        """Whether common sense only was required."""
        return (self.key or "").endswith(ABLATED)

    @property
    def programs(self) -> Mapping[Key, str]:
        """The programs that were judged, but those that have changed or are gone since."""
        stale = set(self.stale)
        return {key: c.program for key, c in self.completions.items() if key not in stale}

    def row(self, key: Key) -> Row:
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


def selected_tasks(head: Mapping[str, Any]) -> frozenset[str] | None:
    """The tasks that a KEY.json names; None for all."""
    tasks = head.get("tasks")
    return None if tasks is None else frozenset(tasks)


ShowProgress: TypeAlias = Callable[
    [Iterator[LocatedRow], int], Iterable[LocatedRow]
]  # passes rows on; gets their number


def no_progress(lines: Iterator[LocatedRow], _total: int) -> Iterable[LocatedRow]:
    """Pass lines on."""
    return lines


def read_judged(
    run: Run, key: str, suite: Suite | None = None, *, task: str, progress: ShowProgress = no_progress
) -> RunEvaluation:
    """Read what an evaluation of a run says of one task, without its table; raise what is wrong."""

    def wanted(line: bytes) -> bool:
        return name in line or b"\\u" in line  # an escape may be a letter of it

    name = json.dumps(task, ensure_ascii=False).encode()
    about, completions = read_written(run, None, wanted)
    completions = {key: one for key, one in completions.items() if one.task == task}
    passed, stale = [], []

    def add(row: Row) -> None:
        if row["task"] != task:
            return
        written = completions.get(key_of(row))
        if row["passed"]:
            passed.append(key_of(row))
        if written is None or written.program_sha256 != row["program_sha256"]:
            stale.append(key_of(row))

    head, places = read_rows(run, key, completions, add, progress=progress, wanted=wanted)
    return RunEvaluation(
        run=run,
        key=key,
        suite=suite,
        head=head,
        about=about,
        completions=completions,
        places={key: place for key, place in places.items() if key[0] == task},
        passed=passed,
        stale=stale,
    )


def read_rows(
    run: Run,
    key: str | None,
    completions: Iterable[Key],
    add: Callable[[Row], None],
    *,
    faults: list[UserError] | None = None,
    on_line: Callable[[bytes], None] | None = None,
    progress: ShowProgress = no_progress,
    wanted: Callable[[bytes], bool] = bool,
) -> tuple[Mapping[str, Any], Mapping[Key, tuple[int, int]]]:
    """Add each row of an evaluation; return its head, and where each row is in the file."""
    head = {} if key is None else _head(run.head(key), faults)
    tasks = selected_tasks(head)
    total = sum(tasks is None or task in tasks for task, _, _ in completions)
    places: dict[Key, tuple[int, int]] = {}
    lines = (
        iter(())
        if key is None
        else read_lines_of(run.rows(key), head, on_line=on_line, faults=faults, wanted=wanted)
    )
    for line in progress(lines, total):
        add(line.row)
        places[key_of(line.row)] = line.at, line.size
    return head, places


def read_written(
    run: Run, faults: list[UserError] | None, wanted: Callable[[bytes], bool] = bool
) -> tuple[Mapping[str, Any], Mapping[Key, Completion]]:
    """How a run's completions were asked for, and they themselves."""
    about = _head(run.about, faults) if run.about.exists() else {}
    completions = read_completions(run.completions, growing=True, faults=faults, wanted=wanted)
    return about, {(sys.intern(one.task), one.prompt, one.index): one for one in completions}


def _head(path: Path, faults: list[UserError] | None) -> Mapping[str, Any]:
    try:
        return load_head(path)
    except UserError as error:
        add_or_raise(error, faults)
        return {}
