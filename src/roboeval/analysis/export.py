"""An evaluation as one flat table for spreadsheets and notebooks: a row for each completion and world."""

from __future__ import annotations

import io
from pathlib import Path

import polars as pl

from codebotler.badinput import BadInput
from codebotler.files import write_whole

FORMATS = ("csv", "parquet")
BEGINNINGS = (b"task,prompt,index,model,", b"PAR1")
"""What a file of such a table begins with, by its format."""


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
