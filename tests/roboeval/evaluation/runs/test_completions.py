"""Rows of completions: accepted rows can be copied and read again, and all others are refused."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codebotler.core.errors import UserError
from codebotler.core.files import MAX_ROW, Appender, to_line, write_whole
from roboeval.evaluation.runs.completions import read_completions
from roboeval.evaluation.runs.folder import RunFolder
from roboeval.evaluation.runs.source import open_source
from roboeval.suites.load import Suite

ROW = {"task": "SayGoodDay", "prompt": 0, "index": 0, "program": "x = 1"}


def error_about(path: Path, line: bytes) -> UserError:
    path.write_bytes(line)
    with pytest.raises(UserError) as caught:
        list(read_completions(path))
    assert (str(caught.value.file), caught.value.line) == (str(path), 1)
    return caught.value


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("prompt", 10**9, "999,999,999"),
        ("index", 10**9, "999,999,999"),
        ("index", 10**25, "999,999,999"),
        ("index", -1, "whole number"),
        ("index", True, "whole number"),
        ("index", "3", "whole number"),
    ],
)
def test_a_wrong_number_is_refused(tmp_path: Path, name: str, value: object, expected: str) -> None:
    error = error_about(tmp_path / "a.jsonl", to_line(ROW | {name: value}))
    assert f"{name} is {value!r}, " in error.sentence
    assert expected in error.sentence


@given(st.dictionaries(st.text(), st.text(st.characters()) | st.integers() | st.floats(allow_nan=False)))
def test_a_row_becomes_one_line_that_reads_the_same(row: dict[str, Any]) -> None:
    line = to_line(row)
    assert line.decode().count("\n") == 1
    assert json.loads(line) == json.loads(json.dumps(row))


@pytest.mark.parametrize(
    "program",
    [
        "\ud800" + "é" * 2_400_000,
        "\ud800" * 800_000,
        "é" * 2_400_000,
        "\n" * 2_400_000,
    ],
)
def test_rows_near_the_limit_can_be_read_from_their_copy(tmp_path: Path, paper: Suite, program: str) -> None:
    path = tmp_path / "a.jsonl"
    row = ROW | {"program": program}
    path.write_text(json.dumps(row, ensure_ascii=False).replace("\ud800", "\\ud800"))
    run = RunFolder(tmp_path / "run")
    run.import_completions(open_source(str(path), paper).completions)
    assert [c.program for c in read_completions(run.completions)] == [program]


@pytest.mark.slow
def test_a_row_whose_copy_would_be_too_long_is_refused(tmp_path: Path, paper: Suite) -> None:
    path = tmp_path / "a.jsonl"
    line = json.dumps(ROW | {"usage": [1] * 2_400_000}, separators=(",", ":")).encode()
    assert len(line) < MAX_ROW
    assert "5,000,000 bytes" in error_about(path, line).sentence
    with pytest.raises(UserError, match="5,000,000 bytes"):
        RunFolder(tmp_path / "run").import_completions(open_source(str(path), paper).completions)
    assert not (tmp_path / "run").exists()


# --- writing to the disk


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Path, frozenset[str]]]:
    """Record what is synced to the disk, each with its files if it is a folder."""
    found: list[tuple[Path, frozenset[str]]] = []
    fsync = os.fsync

    def record_sync(descriptor: int) -> None:
        path = Path(f"/proc/self/fd/{descriptor}").readlink()
        found.append(
            (path, frozenset(file.name for file in path.iterdir()) if path.is_dir() else frozenset())
        )
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", record_sync)
    return found


def test_a_line_is_synced_on_request_and_on_close(
    tmp_path: Path, synced: list[tuple[Path, frozenset[str]]]
) -> None:
    file = Appender(tmp_path / "a.jsonl")
    synced.clear()
    file.append(b"{}\n")
    assert synced == []
    file.sync()
    assert synced == [(tmp_path / "a.jsonl", frozenset())]
    file.close()
    assert synced == [(tmp_path / "a.jsonl", frozenset())] * 2


def test_a_new_file_syncs_its_folder(tmp_path: Path, synced: list[tuple[Path, frozenset[str]]]) -> None:
    Appender(tmp_path / "a.jsonl").close()
    assert (tmp_path, frozenset({"a.jsonl"})) in synced
    synced.clear()
    Appender(tmp_path / "a.jsonl").close()
    assert tmp_path not in dict(synced)  # The folder has the file already.


def test_a_file_written_whole_syncs_itself_and_its_folder(
    tmp_path: Path, synced: list[tuple[Path, frozenset[str]]]
) -> None:
    write_whole(tmp_path / "run.json", b"{}")
    assert synced == [(tmp_path / "run.json.new", frozenset()), (tmp_path, frozenset({"run.json"}))]


def test_a_new_run_syncs_its_parent_folders(
    tmp_path: Path, synced: list[tuple[Path, frozenset[str]]]
) -> None:
    with RunFolder(tmp_path / "runs" / "one").writing():
        pass
    assert synced == [
        (tmp_path / "runs", frozenset({"one"})),
        (tmp_path, frozenset({"runs"})),
    ]
