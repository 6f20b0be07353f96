"""The flat table of an evaluation, as CSV and as parquet."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import polars as pl
import pytest

from codebotler.core.errors import UserError
from made_results import results_of
from roboeval.evaluation.runs.completions import Completion
from roboeval.evaluation.runs.table import COMPLETION_COLUMNS, WORLD_COLUMNS, table_format, write_table

PROGRAM = "def task_program():\n    go_to('x')\n"
COMPLETION = Completion(task="Visit", prompt=1, index=2, program=PROGRAM, model="recorded:careful")


COLUMNS = {**COMPLETION_COLUMNS, **WORLD_COLUMNS}


def table(rows: Iterable[Mapping[str, Any]], completions: Sequence[Completion]) -> pl.DataFrame:
    return results_of(rows, completions=completions).table


def verdict(world: str, **changes: Any) -> dict[str, Any]:  # noqa: ANN401 - parts of a row
    satisfied = {"satisfied": True, "status": "finished", "error": None, "line": None, "failed_checks": []}
    return {"world": world, **satisfied, "trace": [["say", "hi"]], **changes}


def row(*verdicts: dict[str, Any]) -> dict[str, Any]:
    why = {
        "class": "RobotExecutionError",
        "kind": "GoToInvalidLocation",
        "world": min(1, len(verdicts) - 1),
        "check": None,
    }
    return {
        "task": "Visit",
        "prompt": 1,
        "index": 2,
        "passed": False,
        "failure": why,
        "verdicts": list(verdicts),
    }


def row_with_message(message: str) -> dict[str, Any]:
    error = {"kind": "ValueError", "message": message}
    return row(verdict("in", satisfied=False, status="python-error", error=error, line=4))


LOST = {"kind": "GoToInvalidLocation", "message": 'there is no room "x"'}
ROW = row(
    verdict("alice is in"),
    verdict("lost", satisfied=False, status="robot-error", error=LOST, line=2, trace=[]),
    verdict("out", satisfied=False, failed_checks=["visits", 'not greets("amy")']),
)


def test_each_world_of_a_completion_is_a_row() -> None:
    frame = table([ROW], [COMPLETION])
    assert frame.columns == [*COLUMNS]
    assert frame.row(1, named=True) == {
        "task": "Visit",
        "prompt": 1,
        "index": 2,
        "model": "recorded:careful",
        "program_sha256": hashlib.sha256(PROGRAM.encode()).hexdigest(),
        "passed": False,
        "failure_class": "RobotExecutionError",
        "failure_kind": "GoToInvalidLocation",
        "failure_world": 1,
        "failure_check": None,
        "instruction": None,
        "program": PROGRAM,
        "no_program": None,
        "finish_reason": None,
        "cut_off": None,
        "input_tokens": None,
        "output_tokens": None,
        "reasoning_tokens": None,
        "latency_s": None,
        "mode": "program",
        "ending": None,
        "mission_world": None,
        "turns": 1,
        "tool_errors": None,
        "cost": None,
        "accepted": None,
        "world_number": 1,
        "world": "lost",
        "satisfied": False,
        "status": "robot-error",
        "error_kind": "GoToInvalidLocation",
        "error_message": 'there is no room "x"',
        "line": 2,
        "failed_checks": None,
        "category": None,
        "events": 0,
    }
    assert frame["failed_checks"].to_list() == [None, None, 'visits; not greets("amy")']


def test_replies_are_in_the_table() -> None:
    more = {"no_program": "cut-off", "finish_reason": "length", "usage": {"reasoning_tokens": 7}}
    said = replace(COMPLETION, instruction="Visit her.", more=more)
    names = ["instruction", "program", "no_program", "finish_reason", "cut_off", "reasoning_tokens"]
    (cells, *_) = table([ROW], [said]).select(names).rows()
    assert cells == ("Visit her.", PROGRAM, "cut-off", "length", True, 7)


def test_a_passed_row_without_its_completion_has_empty_cells() -> None:
    frame = table([{**row(verdict("in")), "passed": True, "failure": None}], [])
    assert frame.select("model", "failure_class", "line").row(0) == (None, None, None)


def test_no_rows_are_an_empty_table_with_all_columns(tmp_path: Path) -> None:
    write_table(table([], []), tmp_path / "t.csv", "csv")
    assert (tmp_path / "t.csv").read_text() == ",".join(COLUMNS) + "\n"


@pytest.mark.parametrize("message", ["plain", 'a "quote", a comma\nand a line', "\x1b[2J", "日本", ""])
def test_both_formats_keep_a_table(message: str, tmp_path: Path) -> None:
    frame = table([ROW, row_with_message(message)], [COMPLETION])
    for kind in ("csv", "parquet"):
        write_table(frame, tmp_path / kind, kind)
    assert pl.read_parquet(tmp_path / "parquet").equals(frame)
    assert pl.read_csv(tmp_path / "csv", schema=dict(COLUMNS)).equals(frame)


def test_the_same_table_gives_the_same_bytes(tmp_path: Path) -> None:
    for kind in ("csv", "parquet"):
        for name in ("one", "two"):
            write_table(table([ROW] * 3, [COMPLETION]), tmp_path / name, kind)
        assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_the_bytes_of_a_csv(tmp_path: Path) -> None:
    write_table(table([row(verdict("in"))], []), tmp_path / "t", "csv")
    (line,) = (tmp_path / "t").read_bytes().splitlines()[1:]
    assert line.startswith(b"Visit,1,2,,")
    assert b",false,RobotExecutionError,GoToInvalidLocation,0,,," in line
    assert line.endswith(b",,program,,,1,,,,0,in,true,finished,,,,,,1")


@pytest.mark.parametrize("message", ["=cmd()", "+1", "-1", "@x", "\t=1", "\r=1", "\n=1"])
def test_csv_escapes_formulas_and_parquet_keeps_them(message: str, tmp_path: Path) -> None:
    frame = table([row_with_message(message)], [COMPLETION])
    write_table(frame, tmp_path / "t.csv", "csv")
    write_table(frame, tmp_path / "t.parquet", "parquet")
    assert pl.read_csv(tmp_path / "t.csv")["error_message"].item() == "'" + message
    assert pl.read_parquet(tmp_path / "t.parquet")["error_message"].item() == message


def test_a_lone_surrogate_is_escaped(tmp_path: Path) -> None:
    completion = Completion(task="Visit", prompt=1, index=2, program="'\ud800'")
    frame = table([row_with_message("\ud800")], [completion])
    write_table(frame, tmp_path / "t", "csv")
    assert frame["error_message"].item() == r"\ud800"


def test_writing_a_table_follows_links_and_keeps_pipes(tmp_path: Path) -> None:
    write_table(table([], []), tmp_path / "t", "parquet")
    (tmp_path / "link").symlink_to("t")
    write_table(table([], []), tmp_path / "link", "csv")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "t").read_text().startswith("task,")
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    write_table(table([], []), tmp_path / "pipe", "csv")
    assert (tmp_path / "pipe").is_fifo()
    assert os.read(reader, 100).startswith(b"task,")
    os.close(reader)


@pytest.mark.slow
def test_a_long_table_keeps_its_order() -> None:
    rows = [{**row(verdict("in")), "index": index} for index in range(25_000)]
    assert table(iter(rows), [])["index"].to_list() == list(range(25_000))


def test_a_wrong_format_or_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r'"xlsx".* csv, parquet'):
        write_table(table([], []), tmp_path / "t", "xlsx")
    with pytest.raises(UserError, match="folder does not exist") as error:
        write_table(table([], []), tmp_path / "no" / "t.csv", "csv")
    assert error.value.file == tmp_path / "no"


def test_the_name_of_a_file_decides_the_format() -> None:
    names = (None, "x", "x.txt", "x.csv", "x.PARQUET", "dir.parquet/x")
    kinds = [table_format(None if name is None else Path(name)) for name in names]
    assert kinds == ["csv", "csv", "csv", "csv", "parquet", "csv"]
