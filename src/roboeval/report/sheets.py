"""What the page of a report consists of: tables, which stand in CSV files as well, figures and texts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import polars as pl
import yaml
from matplotlib.figure import Figure

from codebotler.badinput import Loader
from roboeval.analysis.cluster import Cluster
from roboeval.evaluation.failures import label_of
from roboeval.evaluation.runs.table import write_table

Kind: TypeAlias = Literal["text", "class", "share", "difference", "count", "number"]
Cell: TypeAlias = str | int | float | None


@cache
def page_words() -> dict[str, dict[str, Any]]:
    """What page.yaml says of sections, figures, tables and notes, by their names."""
    text = Path(__file__).with_name("page.yaml").read_text()
    return yaml.load(text, Loader)  # type: ignore[no-any-return]  # noqa: S506 - a safe one


def described(kind: str, name: str) -> Any:  # noqa: ANN401 - a text, or several
    """What page.yaml says of one of them."""
    return page_words()[kind][name]


def note(name: str) -> str:
    """What a reader must know."""
    return str(described("notes", name))


class Column(NamedTuple):
    """A column of a table.

    Args:
        head: its name, which may be that of a model.
        kind: what stands in it: a text, a class of failures, a share from 0 to 1, a difference of shares, a
            whole number, or any.
    """

    head: str
    kind: Kind = "text"


@dataclass(frozen=True)
class Sheet:
    """A table.

    Args:
        name: of its file, without the ending, and in page.yaml.
        columns: at least one.
        rows: a cell for each column; None where there is nothing to say.
        notes: what else a reader must know, such as where a published number does not fit.
    """

    name: str
    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]
    notes: Sequence[str] = ()


def sheet(
    name: str, rows: Sequence[Sequence[Any]], *, notes: Sequence[str] = (), shares: Sequence[str] = ()
) -> Sheet:
    """A table that page.yaml describes.

    Args:
        name: of the table.
        rows: a cell for each column.
        notes: what else a reader must know.
        shares: the heads of further columns, such as the names of models.
    """
    kinds = described("tables", name)["columns"]
    columns = [Column(head, kind) for part in kinds for kind, heads in part.items() for head in heads]
    return Sheet(name, [*columns, *(Column(head, "share") for head in shares)], rows, notes)


@dataclass(frozen=True)
class Picture:
    """A figure.

    Args:
        name: of its files, without the ending, and in page.yaml.
        draw: draws it.
    """

    name: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Prose:
    """Paragraphs of plain text."""

    paragraphs: Sequence[str]


@dataclass(frozen=True)
class Code:
    """A text whose lines and spaces count, such as a command."""

    text: str


@dataclass(frozen=True)
class Groups:
    """Groups of failures, each with the name of its run."""

    shown: Sequence[tuple[str, Cluster]]


Part: TypeAlias = Sheet | Picture | Prose | Code | Groups


@dataclass(frozen=True)
class Section:
    """A section of the page.

    Args:
        name: by which links find it, and page.yaml its title.
        parts: in their order.
    """

    name: str
    parts: Sequence[Part]


def section(name: str, *parts: Part) -> Section:
    """A section of those parts that are not empty."""
    return Section(name, [part for part in parts if not _is_empty(part)])


def _is_empty(part: Part) -> bool:
    match part:
        case Sheet(rows=content) | Prose(content) | Groups(content):
            return not content
    return False


def write_csv(table: Sheet, folder: Path) -> None:
    """Write a table as CSV, with all digits.

    Raises:
        OSError: the file cannot be written.
    """
    types = {"text": pl.String, "class": pl.String, "count": pl.Int64}
    kinds = [types.get(column.kind, pl.Float64) for column in table.columns]
    schema = dict(zip(_heads(table.columns), kinds, strict=True))
    rows = [list(map(_plain, row)) for row in table.rows]
    write_table(
        pl.DataFrame(rows, schema=schema, orient="row", strict=False), folder / f"{table.name}.csv", "csv"
    )


def _heads(columns: Sequence[Column]) -> list[str]:
    """The heads, with a number behind those that others have, such as that of a model named `task`."""
    heads: list[str] = []
    for column in columns:
        plain = _head(column.head)
        others = (f"{plain} #{number}" for number in count(2))
        heads.append(plain if plain not in heads else next(head for head in others if head not in heads))
    return heads


def _head(head: str) -> str:
    """A head that no spreadsheet takes for a formula, as `write` does it for cells."""
    plain = str(_plain(head))
    return f"'{plain}" if plain.startswith(("=", "+", "-", "@", "\t", "\r", "\n")) else plain


def _plain(cell: Cell) -> Cell:
    return cell.encode(errors="backslashreplace").decode() if isinstance(cell, str) else cell


def told(cell: Cell, kind: Kind) -> str:
    """A cell as a person reads it."""
    if cell is None:
        return "-"
    if isinstance(cell, str):
        return label_of(cell) if kind == "class" else cell
    match kind:
        case "share":
            return f"{cell:.3f}"
        case "difference":
            return f"{cell:+.3f}" if round(cell, 3) else "0.000"
        case "count":
            return f"{cell:,}"
    return f"{cell:,.4g}"
