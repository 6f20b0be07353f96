"""An evaluation as one flat table for spreadsheets and notebooks: a row for each completion and world."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import polars as pl

from codebotler.badinput import BadInput
from codebotler.files import write_whole
from roboeval.evaluation.completions import Completion, Key

FORMATS = ("csv", "parquet")
CHUNK = 10_000  # rows of the table that are held as Python objects at one time

COLUMNS: Mapping[str, type[pl.DataType]] = {
    "task": pl.String,
    "prompt": pl.Int64,
    "index": pl.Int64,
    "model": pl.String,
    "program_sha256": pl.String,
    "passed": pl.Boolean,
    "failure_class": pl.String,
    "failure_kind": pl.String,
    "world_number": pl.Int64,
    "world": pl.String,
    "satisfied": pl.Boolean,
    "status": pl.String,
    "error_kind": pl.String,
    "error_message": pl.String,
    "line": pl.Int64,
    "failed_checks": pl.String,
    "events": pl.Int64,
}
"""The columns and their types; `passed` and the failure are the completion's, what follows is the world's."""


BEGINNINGS = (",".join(COLUMNS).encode(), b"PAR1")
"""What a file of such a table begins with, by its format."""


def table(rows: Iterable[Mapping[str, Any]], completions: Iterable[Completion]) -> pl.DataFrame:
    """The verdicts of an evaluation, one row for each completion and world, in the order of both.

    `prompt`, `index` and `world_number` count from 0; failed checks are joined by "; ".

    Args:
        rows: of the evaluation.
        completions: that were judged; model and program are empty for a row whose completion is not there.
    """
    written = {completion.key: (completion.model, completion.program_sha256) for completion in completions}
    records = (record for row in rows for record in _records(row, written))
    frame = pl.DataFrame(schema=dict(COLUMNS))
    while chunk := list(islice(records, CHUNK)):
        frame.vstack(pl.DataFrame(chunk, schema=dict(COLUMNS), orient="row"), in_place=True)
    return frame.rechunk()


def _records(
    row: Mapping[str, Any], written: Mapping[Key, tuple[str | None, str]]
) -> Iterator[tuple[Any, ...]]:
    model, program = written.get((row["task"], row["prompt"], row["index"]), (None, None))
    failure = row["failure"] or {"class": None, "kind": None}
    for number, verdict in enumerate(row["verdicts"]):
        error = verdict["error"] or {"kind": None, "message": None}
        yield (
            _storable(row["task"]),
            row["prompt"],
            row["index"],
            _storable(model),
            program,
            row["passed"],
            failure["class"],
            _storable(failure["kind"]),
            number,
            _storable(verdict["world"]),
            verdict["satisfied"],
            verdict["status"],
            _storable(error["kind"]),
            _storable(error["message"]),
            verdict["line"],
            _storable("; ".join(verdict["failed_checks"]) or None),
            len(verdict["trace"]) + verdict.get("cut", {"events": 0})["events"],
        )


def _storable(text: str | None) -> str | None:
    """A text that UTF-8 can hold; half of a surrogate pair is written out as an escape."""
    return None if text is None else text.encode(errors="backslashreplace").decode()


def kind_of(path: Path | None) -> str:
    """The format that a file's name asks for; csv if it asks for none."""
    ending = "" if path is None else path.suffix.removeprefix(".").lower()
    return ending if ending in FORMATS else FORMATS[0]


def write(frame: pl.DataFrame, path: Path, kind: str) -> None:
    """Write a table to a file; the same table gives the same bytes.

    A spreadsheet takes a cell that starts with =, +, -, @, a tab or a line end for a formula, and texts here
    come from models. So in CSV such a text gets a ' in front, as OWASP advises; parquet holds it as it is.

    Args:
        frame: the table.
        path: the file; replaced if it is there, once all is written.
        kind: csv or parquet.

    Raises:
        BadInput: there is no such format or folder.
        OSError: the file cannot be written; then what stood there stays.
    """
    if kind not in FORMATS:
        raise BadInput(f'there is no format "{kind}"; choose one of {", ".join(FORMATS)}')
    if not path.parent.is_dir():
        raise BadInput("there is no such folder", file=path.parent)
    content = io.BytesIO()
    if kind == "csv":
        _harmless(frame).write_csv(content)
    else:
        frame.write_parquet(content)
    if path.exists() and not path.is_file():  # such as /dev/stdout, which nothing may take the place of
        path.write_bytes(content.getvalue())
    else:
        write_whole(path.resolve() if path.is_symlink() else path, content.getvalue())


def _harmless(frame: pl.DataFrame) -> pl.DataFrame:
    return frame.with_columns(pl.col(pl.String).str.replace(r"^([=+\-@\t\r\n])", "'${1}"))
