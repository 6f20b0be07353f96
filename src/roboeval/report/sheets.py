"""Defines the parts of a report: tables (also written as CSV files), figures and text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import polars as pl
import yaml
from matplotlib.figure import Figure

from codebotler.core.yaml_files import Loader
from roboeval.analysis.comparisons.compare import MIN_SHOWN_P
from roboeval.analysis.failure_groups import FailureGroup
from roboeval.analysis.metrics import Estimate
from roboeval.evaluation.judging.failures import label_of
from roboeval.evaluation.runs.table import storable, write_table

ColumnKind: TypeAlias = Literal["text", "class", "share", "difference", "count", "number", "p"]
Cell: TypeAlias = str | int | float | None


@cache
def page_words() -> dict[str, dict[str, Any]]:
    """Read page.yaml, which contains the text of sections, figures, tables and notes by name."""
    text = Path(__file__).with_name("page.yaml").read_text()
    return yaml.load(text, Loader)  # type: ignore[no-any-return]  # noqa: S506 - a safe loader; YAML is untyped


def page_text(kind: str, name: str) -> Any:  # noqa: ANN401 - a string, or a mapping for tables
    """Return an entry of page.yaml, such as `overall` of kind `figures`: a text or, for tables, a mapping."""
    return page_words()[kind][name]


def note(name: str) -> str:
    """Return the text of a note from page.yaml."""
    return str(page_text("notes", name))


class Column(NamedTuple):
    """A column of a table: its heading and the kind of its cells."""

    head: str
    kind: ColumnKind = "text"  # "class" is a class of failures; "share" is from 0 to 1


class Sheet(NamedTuple):
    """A table of a report, also written as a CSV file."""

    name: str  # the key in page.yaml and the name of the CSV file
    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]
    notes: Sequence[str] = ()


def sheet(
    name: str, rows: Sequence[Sequence[Any]], *, notes: Sequence[str] = (), shares: Sequence[str] = ()
) -> Sheet:
    """Create the table `name` with its columns in page.yaml, plus a column of shares for each of `shares`."""
    kinds = page_text("tables", name)["columns"]
    columns = [Column(head, kind) for part in kinds for kind, heads in part.items() for head in heads]
    return Sheet(name, [*columns, *(Column(head, "share") for head in shares)], rows, notes)


class ReportFigure(NamedTuple):
    """A figure of a report, with the function that draws it when the report is written."""

    name: str  # the key in page.yaml and the name of the files
    draw: Callable[[], Figure]
    about: Sequence[str] = ()  # sentences about the runs to add to the caption


class Prose(NamedTuple):
    """Paragraphs of a report. Text in backticks is shown as code."""

    paragraphs: Sequence[str]


class Groups(NamedTuple):
    """Groups of similar failures in a report, each with the name of its run."""

    shown: Sequence[tuple[str, FailureGroup]]


class Card(NamedTuple):
    """A short summary of a run: its pass@1, coverage, cost and most frequent failure."""

    name: str
    passed: Estimate  # pass@1
    coverage: str  # describes the judged completions and tasks
    failure: str  # describes the most frequent failure; empty if nothing failed
    cost: str  # describes the cost; empty if unknown
    warning: str = ""  # that many replies were cut off; empty if few were


class Cards(NamedTuple):
    """Summaries of runs, shown side by side at the start of a report."""

    cards: Sequence[Card]


Part: TypeAlias = Sheet | ReportFigure | Prose | Groups | Cards


class Section(NamedTuple):
    """A section of a report: its tables, figures and texts, in order."""

    name: str  # the key in page.yaml and the anchor
    parts: Sequence[Part]


def section(name: str, *parts: Part) -> Section:
    """Create a section from the parts that are not empty."""
    return Section(name, [part for part in parts if not _is_empty(part)])


def _is_empty(part: Part) -> bool:
    match part:
        case Sheet(rows=content) | Prose(content) | Groups(content) | Cards(content):
            return not content
    return False


def write_csv(table: Sheet, folder: Path) -> None:
    """Write a table with full precision to a folder, as a CSV file with the table's name."""
    types = {"text": pl.String, "class": pl.String, "count": pl.Int64}
    kinds = [types.get(column.kind, pl.Float64) for column in table.columns]
    schema = dict(zip(_heads(table.columns), kinds, strict=True))
    rows = [[storable(cell) if isinstance(cell, str) else cell for cell in row] for row in table.rows]
    frame = pl.DataFrame(rows, schema=schema, orient="row", strict=False)
    write_table(frame, folder / f"{table.name}.csv", "csv")


def _heads(columns: Sequence[Column]) -> list[str]:
    """Return the headings of columns. Numbers make them unique, because a model may be named `task`."""
    heads: list[str] = []
    for column in columns:
        plain = storable(column.head)
        if plain.startswith(("=", "+", "-", "@", "\t", "\r", "\n")):
            plain = f"'{plain}"  # otherwise spreadsheets would read it as a formula
        others = (f"{plain} #{number}" for number in count(2))
        heads.append(plain if plain not in heads else next(head for head in others if head not in heads))
    return heads


def format_cell(cell: Cell, kind: ColumnKind) -> str:
    """Format a cell by the kind of its column: 0.5 is `0.500` as a share, and `+0.500` as a difference."""
    if cell is None or isinstance(cell, str):
        return "-" if cell is None else label_of(cell) if kind == "class" else cell
    match kind:
        case "share":
            return f"{cell:.3f}"
        case "difference":
            return f"{cell:+.3f}" if round(cell, 3) else "0.000"
        case "count":
            return f"{cell:,}"
        case "p":
            return f"< {MIN_SHOWN_P}" if cell < MIN_SHOWN_P else f"{cell:.3f}"
    return f"{cell:,.4g}"
