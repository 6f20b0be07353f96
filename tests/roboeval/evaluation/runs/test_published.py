"""Folders and zips of published completions: the files, their order, and refusals."""

import struct
import tracemalloc
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest

from codebotler.core.errors import UserError
from roboeval.evaluation.runs import published
from roboeval.evaluation.runs.published import published_completions

FILE = "name = 'n'\nprompt = 'p'\ncompletion = 'x = 1'\n"


def write_zip(path: Path, members: Mapping[str, str | bytes], how: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", how) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def error_about(path: Path) -> UserError:
    with pytest.raises(UserError) as caught:
        list(published_completions(path))
    return caught.value


def test_an_assignment_may_be_annotated(tmp_path: Path) -> None:
    text = "prompt: str\nname: str = 'n'\ncompletion: str = 'x'\n"
    (completion,) = published_completions(write_zip(tmp_path / "a.zip", {"T_0_0.py": text}))
    assert (completion.program, completion.instruction) == ("x", None)


def test_only_matching_names_are_read_in_numerical_order(tmp_path: Path) -> None:
    members: dict[str, str | bytes] = {
        "a/T_0_10.py": FILE,
        "b/T_0_9.py": FILE,
        "B_1_0.py": FILE,
        "__MACOSX/a/._T_0_10.py": b"\xff\xfe",
        "T_0_1.txt": b"\xff",
        "README": "x" * 6_000_000,
        "T_0_0.py/": "",
    }
    path = write_zip(tmp_path / "a.zip", members)
    folder = tmp_path / "folder"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    for source in (path, folder):
        assert [c.key for c in published_completions(source)] == [("B", 1, 0), ("T", 0, 9), ("T", 0, 10)]


@pytest.mark.parametrize(
    ("content", "line", "named"),
    [
        ("prompt = 'p'\n", None, "`completion`"),
        ("completion = 3\n", 1, "`completion` is not a plain string"),
        ("completion = 'x'\nprompt = {1: 2}\n", 2, "`prompt` is not a plain string"),
        ("a = 1\ncompletion = 'x\n", 2, "(unterminated string literal (detected"),
        ("a = 1\ncompletion = f'{x}'\n", 2, "`completion` is not a plain string"),
        ("completion = " + "-" * 100_000 + "1\n", None, "cannot be parsed as Python"),
        (b"a = 1\ncompletion = '\xff'\n", 2, "UTF-8"),
        (b"#" * 5_000_001, None, "is larger than 5,000,000 bytes"),
        ("completion = '" + "\x01" * 1_000_000 + "'\n", None, "this row is longer than 5,000,000 bytes"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(
    tmp_path: Path, content: str | bytes, line: int | None, named: str
) -> None:
    path = write_zip(tmp_path / "a.zip", {"T_0_0.py": FILE, "T_0_1.py": content})
    folder = tmp_path / "folder"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    for source in (path, folder):
        error = error_about(source)
        assert (str(error.file), error.line) == (str(source / "T_0_1.py"), line)
        assert named in error.sentence


def test_two_files_of_one_completion_are_refused(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "a.zip", {"a/T_0_1.py": FILE, "b/T_00_01.py": b"\xff"})
    error = error_about(path)
    assert str(error.file) == f"{path}/b/T_00_01.py"
    assert "T/0/1" in error.sentence
    assert f"{path}/a/T_0_1.py" in error.sentence
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
            archive.writestr("T_0_1.py", FILE)
            archive.writestr("T_0_1.py", FILE)
    assert "T/0/1" in error_about(tmp_path / "b.zip").sentence


@pytest.mark.parametrize("name", ["notes.py", "T_0_9999999999.py"])
def test_a_misnamed_program_is_refused(tmp_path: Path, name: str) -> None:
    path = write_zip(tmp_path / "a.zip", {"T_0_0.py": FILE, name: FILE})
    error = error_about(path)
    assert str(error.file) == f"{path}/{name}"
    assert "TASK_PROMPT_INDEX.py" in error.sentence


def test_a_zip_without_completions_is_refused(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "a.zip", {"notes.txt": FILE, "T_0_0.py/": ""})
    error = error_about(path)
    assert error.file == path
    assert "TASK_PROMPT_INDEX.py" in error.sentence


def test_an_encrypted_member_is_refused(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "a.zip", {"T_0_0.py": FILE})
    data = bytearray(path.read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    error = error_about(path)
    assert error.file == path
    assert "is encrypted" in error.sentence


@pytest.mark.slow
@pytest.mark.parametrize("how", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_member_that_cannot_be_unpacked_in_pieces_is_refused(tmp_path: Path, how: int) -> None:
    path = write_zip(tmp_path / "a.zip", {"T_0_0.py": FILE + "#" * 100_000_000}, how)
    error = error_about(path)
    assert str(error.file) == f"{path}/T_0_0.py"
    assert '"deflate"' in error.sentence


@pytest.mark.parametrize("declared", [1, len(FILE) - 1, len(FILE) + 1, 5_000_000, 4_000_000_000])
def test_a_member_with_a_false_size_is_read_whole_or_refused(tmp_path: Path, declared: int) -> None:
    path = write_zip(tmp_path / "a.zip", {"T_0_0.py": FILE})
    data = bytearray(path.read_bytes())
    struct.pack_into("<L", data, data.index(b"PK\x01\x02") + 24, declared)
    path.write_bytes(data)
    if declared < len(FILE):
        error = error_about(path)
        assert error.file == path
        assert "(Bad CRC-32" in error.sentence
    else:
        assert [c.program for c in published_completions(path)] == ["x = 1"]


@pytest.mark.slow
def test_a_bomb_that_hides_its_size_is_not_unpacked(tmp_path: Path) -> None:
    path = write_zip(tmp_path / "a.zip", {"T_0_0.py": FILE + "#" * 300_000_000})
    data = bytearray(path.read_bytes())
    struct.pack_into("<L", data, data.index(b"PK\x01\x02") + 24, 4_000_000_000)
    path.write_bytes(data)
    tracemalloc.start()
    try:
        error = error_about(path)
        assert str(error.file) == f"{path}/T_0_0.py"
        assert "5,000,000 bytes" in error.sentence
        assert tracemalloc.get_traced_memory()[1] < 25_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.slow
def test_members_are_held_in_memory_one_at_a_time(tmp_path: Path) -> None:
    members = {f"T_0_{index}.py": f"completion = '{'#' * 1_000_000}'\n" for index in range(60)}
    path = write_zip(tmp_path / "a.zip", members)
    tracemalloc.start()
    try:
        assert sum(1 for _ in published_completions(path)) == 60
        assert tracemalloc.get_traced_memory()[1] < 25_000_000
    finally:
        tracemalloc.stop()


def test_the_total_size_of_members_is_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_zip(tmp_path / "a.zip", {f"T_0_{index}.py": FILE for index in range(10)})
    monkeypatch.setattr(published, "MAX_UNPACKED", 9 * len(FILE))
    error = error_about(path)
    assert error.file == path
    assert f"more than {9 * len(FILE)} bytes" in error.sentence
    monkeypatch.setattr(published, "MAX_UNPACKED", 10 * len(FILE))
    assert sum(1 for _ in published_completions(path)) == 10


def test_unknown_escapes_stay_and_surrogate_pairs_are_joined(tmp_path: Path) -> None:
    program = r"completion = '\d \ud83d\ude00 \ud800'" + "\n"
    path = write_zip(tmp_path / "a.zip", {"T_0_0.py": program})
    assert [c.program for c in published_completions(path)] == ["\\d \U0001f600 \ud800"]
