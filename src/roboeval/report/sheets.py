"""Tables of a report: the same rows stand on the page and in a CSV file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import polars as pl

from roboeval.analysis.export import write

Kind: TypeAlias = Literal["text", "share", "difference", "count", "number"]
Cell: TypeAlias = str | int | float | None

TYPES: dict[Kind, type[pl.DataType]] = {
    "text": pl.String,
    "share": pl.Float64,
    "difference": pl.Float64,
    "count": pl.Int64,
    "number": pl.Float64,
}


class Column(NamedTuple):
    """A column of a table.

    Args:
        head: its name, which may be that of a model.
        kind: what stands in it: a text, a share from 0 to 1, a difference of shares, a whole number, or any.
    """

    head: str
    kind: Kind = "text"


@dataclass(frozen=True)
class Sheet:
    """A table.

    Args:
        name: of its file, without the ending.
        title: what it is called on the page.
        columns: at least one.
        rows: a cell for each column; None where there is nothing to say.
        about: what the numbers are, in sentences.
        notes: what else a reader must know, such as where a published number does not fit.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    about: str = ""
    notes: tuple[str, ...] = ()


def sheet(
    name: str,
    title: str,
    columns: Sequence[Column | str],
    rows: Sequence[Sequence[Cell]],
    *,
    about: str = "",
    notes: Sequence[str] = (),
) -> Sheet:
    """A table; a column that is only named holds text."""
    named = tuple(Column(c) if isinstance(c, str) else c for c in columns)
    return Sheet(name, title, named, tuple(map(tuple, rows)), about, tuple(notes))


def write_csv(table: Sheet, folder: Path) -> None:
    """Write a table as CSV, with all digits.

    Raises:
        OSError: the file cannot be written.
    """
    kinds = [TYPES[column.kind] for column in table.columns]
    schema = dict(zip(_heads(table.columns), kinds, strict=True))
    rows = [
        [_plain(cell, column.kind) for cell, column in zip(row, table.columns, strict=True)]
        for row in table.rows
    ]
    write(pl.DataFrame(rows, schema=schema, orient="row"), folder / f"{table.name}.csv", "csv")


def _heads(columns: Sequence[Column]) -> list[str]:
    """The heads, with a number behind those that others have, such as that of a model named `task`."""
    heads: list[str] = []
    for column in columns:
        plain = head = _head(column.head)
        for number in count(2):
            if head not in heads:
                break
            head = f"{plain} #{number}"
        heads.append(head)
    return heads


def _head(head: str) -> str:
    """A head that no spreadsheet takes for a formula, as `write` does it for cells."""
    plain = head.encode(errors="backslashreplace").decode()
    return f"'{plain}" if plain.startswith(("=", "+", "-", "@", "\t", "\r", "\n")) else plain


def _plain(cell: Cell, kind: Kind) -> Cell:
    if isinstance(cell, str):
        return cell.encode(errors="backslashreplace").decode()
    return float(cell) if cell is not None and kind not in {"text", "count"} else cell


def told(cell: Cell, kind: Kind) -> str:
    """A cell as a person reads it."""
    if cell is None:
        return "-"
    if isinstance(cell, str):
        return cell
    match kind:
        case "share":
            return f"{cell:.3f}"
        case "difference":
            return f"{cell:+.3f}" if round(cell, 3) else "0.000"
        case "count":
            return f"{cell:,}"
    return f"{cell:,.4g}"
