"""Judges a run's completions, going on where an earlier evaluation stopped, and only if it judged alike."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Generator, Iterator, Mapping
from itertools import chain, islice
from pathlib import Path
from typing import Any

from codebotler.badinput import BadInput
from codebotler.files import Appender, length_before, to_line, to_text, write_whole
from roboeval.evaluation.completions import Completion, Key, Row, name_of
from roboeval.evaluation.engines import Local, OpenEngine
from roboeval.evaluation.judge import evaluation, head, judgements
from roboeval.evaluation.rows import HASH_LINE, Seal, is_sealed, read_judged
from roboeval.evaluation.run import Run, evaluation_key, load_head
from roboeval.suites.load import Suite


def evaluate_run(
    run: Run,
    suite: Suite,
    *,
    ablated: bool,
    tasks: frozenset[str] | None,
    redo: bool,
    workers: int = 1,
    require_isolation: bool = False,
    engine: OpenEngine | None = None,
) -> Iterator[Row]:
    """Judge a run's completions, going on where an earlier evaluation stopped; yields all rows in order.

    Args:
        run: whose folder gets the rows.
        suite: by which to judge.
        ablated: whether to require common sense only.
        tasks: which tasks to judge; all by default.
        redo: whether to start over.
        workers: how many programs are run at the same time.
        require_isolation: whether to refuse where a wall around programs is missing.
        engine: where programs are run; by default in so many lanes of this machine.

    Raises:
        BadInput: the run is being written, or was judged otherwise or holds other completions than it did.
    """
    key = evaluation_key(suite, ablated=ablated)
    with run.writing():
        run.rows(key).parent.mkdir(exist_ok=True)
        if redo:
            for path in (run.rows(key), run.programs(key), run.head(key)):
                path.unlink(missing_ok=True)
        about = {**head(suite), "ablation": ablated, "tasks": None if tasks is None else sorted(tasks)}
        was = _go_on_or_refuse(run.head(key), about, run.rows(key))
        with (
            contextlib.closing(Appender(run.programs(key))) as programs,
            contextlib.closing(Appender(run.rows(key))) as rows,
        ):
            completions = run.source(suite).of(tasks)
            left_out = LeftOut(run.head(key))
            seal = yield from _judged(rows, programs, completions, was, left_out)
            left = [*left_out.waiting.values(), *islice(completions, 1)]
            if is_sealed(was) and (left or seal.is_broken(was)):
                write_whole(run.head(key), to_text({**about, **left_out.data()}))
            chosen = engine or Local(workers, require_isolation=require_isolation)
            is_whole = True
            for completion, told in judgements(
                chain(left, completions), suite, ablated=ablated, engine=chosen
            ):
                if told is None:
                    left_out.add(completion)
                    is_whole = False
                    continue
                # The hash comes first: a crash in between leaves one too many, and no row without one.
                programs.append(f"{completion.program_sha256}\n".encode())
                row = evaluation(completion, told)
                rows.append(line := to_line(row))
                seal.add(line)
                yield row
            finished = {**about, **left_out.data(), **seal.data()}
            if is_whole and finished != was:
                programs.sync()
                rows.sync()
                write_whole(run.head(key), to_text(finished))


class LeftOut:
    """The completions that once had no row since judging them took too long; their rows come at the end.

    Args:
        head: KEY.json, which keeps their names.
    """

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
        """As KEY.json names them; nothing where there are none."""
        return {LEFT_OUT: self._names} if self._names else {}


LEFT_OUT = "took_too_long"


def _judged(
    rows: Appender,
    programs: Appender,
    completions: Iterator[Completion],
    was: Mapping[str, Any],
    left_out: LeftOut,
) -> Generator[Row, None, Seal]:
    """The rows that are there, and their seal; afterwards both files end where to go on."""
    count, seal, waiting = 0, Seal(), left_out.waiting
    for number, row, judged in read_judged(rows.path, programs.path, was, seal):
        if judged is None:  # the machine lost its power before the hash was on the disk
            rows.cut(length_before(rows.path, number))
            seal = Seal.of(rows.path)
            break
        found = row["task"], row["prompt"], row["index"]
        completion = waiting.pop(found) if found in waiting else next(completions, None)
        while completion is not None and completion.key != found and completion in left_out:
            waiting[completion.key] = completion
            completion = next(completions, None)
        if completion is None or completion.key != found:
            expected = "nothing more" if completion is None else name_of(completion.key)
            raise BadInput(
                f"judges {name_of(found)} where the completions have {expected}; --redo starts over",
                file=rows.path,
                line=number,
            )
        if completion.program_sha256 != judged:
            raise BadInput(
                f"the program of {name_of(found)} has changed since it was judged; --redo starts over",
                file=rows.path,
                line=number,
            )
        count += 1
        yield row
    programs.cut(HASH_LINE * count)
    return seal


def _go_on_or_refuse(path: Path, about: dict[str, Any], rows: Path) -> dict[str, Any]:
    """What KEY.json says, if what is there was judged alike."""
    if not path.exists():
        if rows.exists() and rows.stat().st_size:
            raise BadInput(
                "is missing, so that nobody knows by what the rows were judged; --redo starts over", file=path
            )
        write_whole(path, to_text(about))
        return about
    was = load_head(path)
    changed = [name for name in about if was.get(name) != about[name]]
    if changed:
        name = changed[0]
        then, now = _brief(name, was.get(name)), _brief(name, about[name])
        what = f"{CALLED.get(name, name)} ({then}, now {now})"
        raise BadInput(f"was judged with another {what}; --redo starts over", file=path)
    return was


CALLED = {
    "version": "version of the suite",
    "digest": "content of the suite",
    "rules": "set of rules",
    "codebotler": "version of this tool",
    "python": "version of Python",
    "tasks": "selection of tasks",
}
LONGEST = 60  # characters of a value that a sentence can bear


def _brief(name: str, value: object) -> str:
    text = json.dumps(value)
    if name == "tasks":
        text = ", ".join(map(str, value)) if isinstance(value, list) else "all"
    return text if len(text) <= LONGEST else text[:LONGEST] + "..."
