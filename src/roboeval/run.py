"""A run: a folder with a model's completions and their evaluations, which survives every interruption."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from codebotler import __version__
from codebotler.badinput import BadInput, read_text
from roboeval.evaluate import evaluate, head
from roboeval.published import published_completions
from roboeval.records import (
    COMPLETIONS,
    Appender,
    Completion,
    check_known,
    name_of,
    read_completions,
    read_evaluations,
    recorded_completions,
    to_line,
)
from roboeval.suite import Suite


@dataclass(frozen=True)
class Source:
    """Where completions come from.

    Args:
        name: how sentences call it.
        read: reads them from the start, each time it is called.
        run: the run folder they stand in, if they do.
    """

    name: str
    read: Callable[[], Iterator[Completion]]
    run: Run | None = None

    def checked(self, suite: Suite, tasks: frozenset[str] | None = None) -> Iterator[Completion]:
        """Read them again, those of some tasks or all; each is one that the suite knows.

        Raises:
            BadInput: one is not.
        """
        for completion in check_known(self.read(), suite, self.name):
            if tasks is None or completion.task in tasks:
                yield completion


def open_source(text: str, suite: Suite) -> Source:
    """Find out what completions a person means.

    Args:
        text: a run folder, a .jsonl file, a folder or zip of published .py files, or `recorded:NAME`.
        suite: whose instructions a recorded model answers.

    Raises:
        BadInput: there is no such thing.
    """
    path = Path(text)
    if text.partition(":")[0] == "recorded" and not path.exists():
        return Source(text, lambda: recorded_completions(text, suite))
    if not path.exists():
        raise BadInput(
            "there is no such file or folder; name a run, a .jsonl, or a folder or zip of .py", file=path
        )
    if (path / COMPLETIONS).is_file():
        run = Run(path)
        return Source(text, lambda: read_completions(run.completions, growing=True), run)
    if path.is_dir() or path.suffix == ".zip":
        return Source(text, lambda: published_completions(path))
    return Source(text, lambda: read_completions(path))


@dataclass(frozen=True)
class Run:
    """The folder of a run.

    Args:
        path: where it is.
    """

    path: Path

    @property
    def completions(self) -> Path:
        """The file of its completions."""
        return self.path / COMPLETIONS

    def rows(self, key: str) -> Path:
        """The file of an evaluation's rows; `key` is the suite's name, with -ablation where ablated."""
        return self.path / "evaluations" / f"{key}.jsonl"

    def head(self, key: str) -> Path:
        """The file that says by what the rows of an evaluation were judged."""
        return self.path / "evaluations" / f"{key}.json"

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Keep other processes from writing this run.

        Raises:
            BadInput: one is writing it, or the folder cannot be written.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path / ".lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise BadInput(f"cannot be written ({error.strerror})", file=self.path) from None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            raise BadInput(
                "another process is writing this run; wait until it has ended", file=self.path
            ) from None
        try:
            yield
        finally:
            os.close(descriptor)

    def keep(self, source: Source, suite: Suite) -> None:
        """Make this the run of a source's completions: copy them, unless they are here already.

        Raises:
            BadInput: one of them is wrong, or other completions are here; then nothing is changed.
        """
        models = {completion.model for completion in source.checked(suite)}
        lines = (to_line(c.model_dump(exclude_unset=True)) for c in source.read())
        if self.completions.exists():
            with self.completions.open("rb") as file:
                if not all(file.read(len(line)) == line for line in lines) or file.read(1):
                    raise BadInput("this run holds other completions; name another folder", file=self.path)
            return
        about = {"model": models.pop() if len(models) == 1 else None, "codebotler": __version__}
        write_whole(self.path / "run.json", [to_text(about)])
        write_whole(self.completions, lines)


def evaluate_run(
    run: Run,
    suite: Suite,
    *,
    ablated: bool,
    tasks: frozenset[str] | None,
    redo: bool,
    workers: int,
    require_isolation: bool = False,
) -> Iterator[dict[str, Any]]:
    """Judge a run's completions, going on where an earlier evaluation stopped; yields all rows in order.

    Args:
        run: whose folder gets the rows.
        suite: by which to judge.
        ablated: whether to require common sense only.
        tasks: which tasks to judge; all by default.
        redo: whether to start over.
        workers: how many programs are run at the same time.
        require_isolation: whether to refuse where a wall around programs is missing.

    Raises:
        BadInput: the run is being written, or was judged otherwise or holds other completions than it did.
    """
    key = evaluation_key(suite, ablated=ablated)
    source = Source(str(run.completions), lambda: read_completions(run.completions, growing=True), run)
    with run.writing():
        rows = run.rows(key)
        rows.parent.mkdir(exist_ok=True)
        if redo:
            rows.unlink(missing_ok=True)
            run.head(key).unlink(missing_ok=True)
        about = {**head(suite), "ablation": ablated, "tasks": None if tasks is None else sorted(tasks)}
        _go_on_or_refuse(run.head(key), about)
        appender = Appender(rows)
        try:
            completions = source.checked(suite, tasks)
            yield from _judged(rows, completions)
            for row in evaluate(
                completions, suite, ablated=ablated, workers=workers, require_isolation=require_isolation
            ):
                appender.append(to_line(row))
                yield row
        finally:
            appender.close()


def _judged(rows: Path, completions: Iterator[Completion]) -> Iterator[dict[str, Any]]:
    for number, row in read_evaluations(rows):
        completion = next(completions, None)
        if completion is None or completion.key != (row["task"], row["prompt"], row["index"]):
            expected = "nothing more" if completion is None else name_of(completion.key)
            found = name_of((row["task"], row["prompt"], row["index"]))
            raise BadInput(
                f"judges {found} where the completions have {expected}; --redo starts over",
                file=rows,
                line=number,
            )
        yield row


def _go_on_or_refuse(path: Path, about: dict[str, Any]) -> None:
    if not path.exists():
        write_whole(path, [to_text(about)])
        return
    was = load_head(path)
    changed = [name for name in about if was.get(name) != about[name]]
    if changed:
        name = {"digest": "content of the suite", "codebotler": "version of this tool"}.get(
            changed[0], changed[0]
        )
        then, now = _brief(was.get(changed[0])), _brief(about[changed[0]])
        raise BadInput(f"was judged with another {name} ({then}, now {now}); --redo starts over", file=path)


LONGEST = 60  # characters of a value that a sentence can bear


def _brief(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= LONGEST else text[:LONGEST] + "..."


def load_head(path: Path) -> dict[str, Any]:
    """Read a KEY.json or run.json.

    Raises:
        BadInput: it is missing or no JSON object.
    """
    try:
        data = json.loads(read_text(path))
    except (ValueError, RecursionError):
        data = None
    if not isinstance(data, dict):
        raise BadInput("is no JSON object", file=path)
    return data


def evaluation_key(suite: Suite, *, ablated: bool) -> str:
    """The name of an evaluation's files."""
    return f"{suite.name}-ablation" if ablated else suite.name


def tasks_to_judge(
    suite: Suite, names: str | None, *, ablated: bool
) -> tuple[frozenset[str] | None, tuple[str, ...]]:
    """Which tasks a person means, and those left out because they have no ablation.

    Args:
        suite: whose tasks.
        names: separated by commas; None for all.
        ablated: whether they need an ablation.

    Raises:
        BadInput: a task is unknown, or none of them has an ablation.
    """
    wanted = (
        tuple(suite.tasks)
        if names is None
        else tuple(suite.task(name.strip()).name for name in names.split(","))
    )
    if not ablated:
        return (None if names is None else frozenset(wanted)), ()
    left = tuple(name for name in wanted if suite.tasks[name].ablation is None)
    kept = frozenset(wanted) - frozenset(left)
    if not kept:
        raise BadInput(f"none of {', '.join(wanted)} has an ablation")
    return kept, left


def write_whole(path: Path, content: Iterable[bytes]) -> None:
    """Write a file piece by piece, so that it is there whole or as it was."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".new")
    try:
        with temporary.open("wb") as file:
            file.writelines(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def to_text(data: dict[str, Any]) -> bytes:
    """A JSON file for people to read."""
    return json.dumps(data, indent=2, ensure_ascii=False).encode() + b"\n"
