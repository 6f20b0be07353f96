"""Judges a run's completions, going on where an earlier evaluation stopped, and only if it judged alike."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Generator, Iterable, Iterator, Mapping
from itertools import chain, islice
from pathlib import Path
from typing import Any

from codebotler.core.errors import UserError
from codebotler.core.files import Appender, to_text, write_whole
from codebotler.core.words import brief
from roboeval.evaluation.engines import Local, OpenEngine
from roboeval.evaluation.judge import head, judgements, row_line
from roboeval.evaluation.runs.completions import Completion, Key, name_of
from roboeval.evaluation.runs.folder import Run, evaluation_key, load_head
from roboeval.evaluation.runs.rows import JudgedRow, Seal, is_sealed, judged_row, read_lines_of
from roboeval.suites.load import Suite


def evaluate_run(
    run: Run,
    suite: Suite,
    *,
    ablated: bool,
    tasks: frozenset[str] | None,  # None for all
    redo: bool,
    workers: int = 1,
    engine: OpenEngine | None = None,
    completions: Iterable[Completion] | None = None,  # those of the run, if they were read before
) -> Iterator[JudgedRow]:
    """Judge a run's completions, going on where an earlier evaluation stopped; yield all rows in order."""
    key = evaluation_key(suite, ablated=ablated)
    with run.writing():
        run.rows(key).parent.mkdir(exist_ok=True)
        if redo:
            for path in (run.rows(key), run.head(key)):
                path.unlink(missing_ok=True)
        about = {**head(suite), "ablation": ablated, "tasks": None if tasks is None else sorted(tasks)}
        was = _go_on_or_refuse(run.head(key), about, run.rows(key))
        with contextlib.closing(Appender(run.rows(key))) as rows:
            written = run.read(suite) if completions is None else completions
            selected = (one for one in written if tasks is None or one.task in tasks)
            left_out = LeftOut(run.head(key))
            seal = yield from _judged_before(rows, selected, was, left_out)
            left = [*left_out.waiting.values(), *islice(selected, 1)]
            if is_sealed(was) and (left or seal.is_broken(was)):
                write_whole(run.head(key), to_text({**about, **left_out.data()}))
            judged = judgements(
                chain(left, selected), suite, ablated=ablated, engine=engine or Local(workers)
            )
            is_whole = yield from _judge(judged, rows, seal, left_out)
            finished = {**about, **left_out.data(), **seal.data()}
            if is_whole and finished != was:
                rows.sync()
                write_whole(run.head(key), to_text(finished))


def _judge(
    judged: Iterable[tuple[Completion, Any]], rows: Appender, seal: Seal, left_out: LeftOut
) -> Generator[JudgedRow, None, bool]:
    """Add the rows of completions; return whether each has one."""
    is_whole = True
    for completion, judgement in judged:
        if judgement is None:
            left_out.add(completion)
            is_whole = False
            continue
        written = row_line(completion, judgement)
        rows.append(written)
        seal.add(written)
        yield judged_row(written)
    return is_whole


LEFT_OUT = "took_too_long"


class LeftOut:
    """The completions that once had no row since judging them took too long; their rows come at the end."""

    def __init__(self, head: Path) -> None:
        self._head = head
        self._names: list[str] = load_head(head).get(LEFT_OUT, [])
        self.waiting: dict[Key, Completion] = {}

    def __contains__(self, completion: Completion) -> bool:
        return name_of(completion.key) in self._names

    def add(self, completion: Completion) -> None:
        """Remember one, before the row of any later one is written."""
        if completion not in self:
            self._names.append(name_of(completion.key))
            write_whole(self._head, to_text({**load_head(self._head), **self.data()}))

    def data(self) -> dict[str, Any]:
        """What KEY.json keeps of them."""
        return {LEFT_OUT: self._names} if self._names else {}


def _judged_before(
    rows: Appender, completions: Iterator[Completion], was: Mapping[str, Any], left_out: LeftOut
) -> Generator[JudgedRow, None, Seal]:
    """Yield the rows of the file and return their seal; `completions` goes on behind the last one."""
    seal, waiting = Seal(), left_out.waiting
    for line in read_lines_of(rows.path, was, seal=seal):
        row = line.row
        completion = waiting.pop(row.key) if row.key in waiting else next(completions, None)
        while completion is not None and completion.key != row.key and completion in left_out:
            waiting[completion.key] = completion
            completion = next(completions, None)
        if completion is None or completion.key != row.key:
            expected = "nothing more" if completion is None else name_of(completion.key)
            sentence = f"judges {name_of(row.key)} where the completions have {expected}"
            raise UserError(f"{sentence}; --redo starts over", file=rows.path, line=line.number)
        if completion.program_sha256 != row.program_sha256:
            sentence = f"the program of {name_of(row.key)} has changed since it was judged"
            raise UserError(f"{sentence}; --redo starts over", file=rows.path, line=line.number)
        yield row
    return seal


def _go_on_or_refuse(path: Path, about: dict[str, Any], rows: Path) -> dict[str, Any]:
    """The content of KEY.json; raises UserError if the rows were judged otherwise."""
    if not path.exists():
        if rows.exists() and rows.stat().st_size:
            raise UserError(
                "is missing, so it is unknown how the rows were judged; --redo starts over", file=path
            )
        write_whole(path, to_text(about))
        return about
    was = load_head(path)
    for name, now in about.items():
        if was.get(name) != now:
            what = f"{CALLED.get(name, name)} ({_brief(name, was.get(name))}, now {_brief(name, now)})"
            raise UserError(f"was judged with another {what}; --redo starts over", file=path)
    return was


CALLED = {
    "version": "version of the suite",
    "digest": "content of the suite",
    "rules": "set of rules of simulation",
    "house_rules": "set of house rules",
    "skills": "set of skills",
    "codebotler": "version of this tool",
    "python": "version of Python",
    "tasks": "selection of tasks",
}


def _brief(name: str, value: object) -> str:
    text = json.dumps(value)
    if name == "tasks":
        text = ", ".join(map(str, value)) if isinstance(value, list) else "all"
    return brief(text)
