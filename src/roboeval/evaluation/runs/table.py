"""Builds the table of a judged run from rows, and writes it to files."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import polars as pl

from codebotler.core.errors import UserError
from codebotler.core.files import write_whole
from roboeval.evaluation.runs.completions import KEY, NO_PROGRAM_COLUMN, Completion, CompletionKey
from roboeval.evaluation.runs.replies import number_or_none, reply_numbers
from roboeval.evaluation.runs.rows import Row, event_count, key_of

Tokens = TypeVar("Tokens", float, pl.Expr)
MILLION = 1_000_000
CHUNK_ROWS = 10_000  # rows held as Python objects at a time

COMPLETION_COLUMNS: Mapping[str, type[pl.DataType]] = {
    "task": pl.String,
    "prompt": pl.Int64,
    "index": pl.Int64,
    "model": pl.String,
    "program_sha256": pl.String,
    "passed": pl.Boolean,
    "failure_class": pl.String,
    "failure_kind": pl.String,
    "failure_world": pl.Int64,
    "failure_check": pl.String,
    "instruction": pl.String,
    "program": pl.String,
    "no_program": pl.String,
    "finish_reason": pl.String,
    "cut_off": pl.Boolean,
    "input_tokens": pl.Int64,
    "output_tokens": pl.Int64,
    "reasoning_tokens": pl.Int64,
    "latency_s": pl.Float64,
    "mode": pl.String,
    "ending": pl.String,
    "mission_world": pl.Int64,
    "turns": pl.Int64,
    "tool_errors": pl.Int64,
    "cost": pl.Float64,
    "accepted": pl.Boolean,
}
"""The columns that describe a completion. They are explained in docs/results.md."""

WORLD_COLUMNS: Mapping[str, type[pl.DataType]] = {
    "world_number": pl.Int64,
    "world": pl.String,
    "satisfied": pl.Boolean,
    "status": pl.String,
    "error_kind": pl.String,
    "error_message": pl.String,
    "line": pl.Int64,
    "failed_checks": pl.String,
    "category": pl.String,
    "events": pl.Int64,
}
"""The columns that describe one world."""


class Price(NamedTuple):
    """The prices of a million input tokens and of a million output tokens, in any currency."""

    input: float
    output: float

    @classmethod
    def read(cls, text: str) -> Price:
        """Parse a text such as `2.5/10`. Raise UserError if it is not two numbers below a million."""
        with suppress(TypeError, ValueError):
            price = cls(*map(float, text.split("/")))
            if all(0 <= number < MILLION for number in price):
                return price
        raise UserError(f'"{text}" is not a price; write INPUT/OUTPUT per million tokens, such as 2.5/10')

    def of(self, input_tokens: Tokens, output_tokens: Tokens) -> Tokens:
        """Compute the cost of tokens, given as numbers or as columns."""
        return (input_tokens * self.input + output_tokens * self.output) / MILLION


def with_cost(table: pl.DataFrame, price: Price) -> pl.DataFrame:
    """Return the table with the column `cost` computed from its tokens."""
    return table.with_columns(cost=price.of(pl.col("input_tokens"), pl.col("output_tokens")))


def keys_where(table: pl.DataFrame, condition: pl.Expr) -> list[CompletionKey]:
    """Return the keys of the completions whose first row matches a condition on the columns."""
    return [*table.filter(condition, pl.col("world_number") == 0).select(KEY).iter_rows()]


def with_answers(table: pl.DataFrame, problems: Mapping[tuple[str, str], Sequence[str]]) -> pl.DataFrame:
    """Fill in `accepted`: true if a program has no `problems`, by (task, hash), or null if not checked."""
    names = ["task", "program_sha256"]
    answers = [(*key, not found) for key, found in problems.items()]
    schema = {**dict.fromkeys(names, pl.String), "accepted": pl.Boolean}
    accepted = pl.DataFrame(answers, schema=schema, orient="row")
    joined = table.drop("accepted").join(accepted, on=names, how="left", maintain_order="left")
    return joined.select(table.columns)


class TableBuilder:
    """Builds the table of `load_results` from rows. `categories` maps (task, requirement) to its category."""

    def __init__(self, categories: Mapping[tuple[str, str], str] = {}) -> None:
        self._categories = categories
        self._frame = pl.DataFrame(schema={**COMPLETION_COLUMNS, **WORLD_COLUMNS})
        self._start()

    def _start(self) -> None:
        self._rows: list[dict[str, Any]] = []
        self._worlds: list[tuple[Any, ...]] = []
        self._counts: list[int] = []

    def add(self, row: Row, written: Completion | None = None) -> None:
        """Add the verdicts of a row. `written` is the judged completion, for columns such as `program`."""
        if len(self._worlds) >= CHUNK_ROWS:
            self._store()
        key = dict(zip(KEY, key_of(row), strict=True))
        judged = {**key, "program_sha256": row["program_sha256"], "passed": row["passed"]}
        failure = {f"failure_{name}": value for name, value in (row["failure"] or {}).items()}
        # Columns without an entry are null.
        self._rows.append({**judged, **failure, **({} if written is None else _known_of(written))})
        self._counts.append(len(row["verdicts"]))
        for number, verdict in enumerate(row["verdicts"]):
            checks, error = verdict["failed_checks"], verdict["error"]
            self._worlds.append(
                (
                    number,
                    verdict["world"],
                    verdict["satisfied"],
                    verdict["status"],
                    None if error is None else error["kind"],
                    None if error is None else error["message"],
                    verdict["line"],
                    "; ".join(checks) or None,
                    self._categories.get((row["task"], checks[0])) if checks else None,
                    event_count(verdict),
                )
            )

    def table(self) -> pl.DataFrame:
        """Return the table of all rows added so far."""
        self._store()
        return self._frame.rechunk()

    def _store(self) -> None:
        completions = pl.DataFrame(self._rows, schema=dict(COMPLETION_COLUMNS))
        worlds = pl.DataFrame(self._worlds, schema=dict(WORLD_COLUMNS), orient="row")
        each = [number for number, count in enumerate(self._counts) for _ in range(count)]
        self._frame.vstack(completions[each].hstack(worlds), in_place=True)
        self._start()


def _known_of(written: Completion) -> dict[str, Any]:
    """Return the texts of a completion, how its model was used, and what the reply or the mission took."""
    texts = {
        "model": written.model,
        "instruction": written.instruction,
        "program": written.program,
        NO_PROGRAM_COLUMN: written.more.get(NO_PROGRAM_COLUMN),
        "finish_reason": written.finish_reason,
    }
    known: dict[str, Any] = {name: storable(text) for name, text in texts.items() if text is not None}
    if written.finish_reason is not None:
        known["cut_off"] = written.is_cut_off
    known |= {"mode": written.mode, "turns": 1, **reply_numbers(written)}
    if (end := written.mission) is None:
        return known
    counts = written.more.get("tool_errors")
    errors = [number_or_none(one, int) or 0 for one in counts.values()] if isinstance(counts, dict) else []
    mission = {"ending": end.ending, "mission_world": end.world, "turns": written.turns}
    return {**known, **mission, "tool_errors": sum(errors)}


def storable(text: str) -> str:
    """Escape the lone surrogates of a string, because tables store UTF-8, which cannot contain them."""
    return text.encode(errors="backslashreplace").decode()


TABLE_FORMATS = ("csv", "parquet")
TABLE_BEGINNINGS = (b"task,prompt,index,model,", b"PAR1")  # the first bytes of tables in these formats


def table_format(path: Path | None) -> str:
    """Return `parquet` if the file name has this suffix, or else `csv`."""
    ending = "" if path is None else path.suffix.removeprefix(".").lower()
    return ending if ending in TABLE_FORMATS else TABLE_FORMATS[0]


def write_table(frame: pl.DataFrame, path: Path, kind: str) -> None:
    """Write a table to a file. `kind` is `csv` or `parquet`. Equal tables produce equal bytes."""
    if kind not in TABLE_FORMATS:
        raise UserError(f'unknown format "{kind}"; choose one of {", ".join(TABLE_FORMATS)}')
    if not path.parent.is_dir():
        raise UserError("the folder does not exist; create it first", file=path.parent)
    content = io.BytesIO()
    if kind == "csv":
        # Spreadsheets treat such cells as formulas, so OWASP recommends prepending an apostrophe.
        frame.with_columns(pl.col(pl.String).str.replace(r"^([=+\-@\t\r\n])", "'${1}")).write_csv(content)
    else:
        frame.write_parquet(content)
    if path.exists() and not path.is_file():  # do not replace special files such as /dev/stdout
        path.write_bytes(content.getvalue())
    else:
        write_whole(path.resolve() if path.is_symlink() else path, content.getvalue())
