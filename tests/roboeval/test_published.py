"""Folders and zips of published completions: what is read, in which order, and what is refused how."""

import struct
import tracemalloc
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest

from codebotler.badinput import BadInput
from roboeval import published
from roboeval.published import published_completions

FILE = "name = 'n'\nprompt = 'p'\ncompletion = 'x = 1'\n"


def zipped(path: Path, members: Mapping[str, str | bytes], how: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", how) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def sentence_about(path: Path) -> str:
    with pytest.raises(BadInput) as caught:
        list(published_completions(path))
    return str(caught.value)


def test_an_assignment_may_be_annotated(tmp_path: Path) -> None:
    text = "prompt: str\nname: str = 'n'\ncompletion: str = 'x'\n"
    (completion,) = published_completions(zipped(tmp_path / "a.zip", {"T_0_0.py": text}))
    assert (completion.program, completion.instruction) == ("x", None)


def test_only_files_of_the_name_are_read_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    members: dict[str, str | bytes] = {
        "a/T_0_10.py": FILE,
        "b/T_0_9.py": FILE,
        "B_1_0.py": FILE,
        "notes.py": b"\xff\xfe",
        "T_0_1.txt": b"\xff",
        "README": "x" * 6_000_000,
        "T_0_0.py/": "",
    }
    path = zipped(tmp_path / "a.zip", members)
    folder = tmp_path / "folder"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    for source in (path, folder):
        assert [c.key for c in published_completions(source)] == [("B", 1, 0), ("T", 0, 9), ("T", 0, 10)]


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("prompt = 'p'\n", "{}: does not assign a text to `completion`"),
        ("completion = 3\n", "{}: does not assign a text to `completion`"),
        ("a = 1\ncompletion = 'x\n", "{}, line 2: is no Python (unterminated string literal (detected"),
        ("a = 1\ncompletion = f'{x}'\n", "{}, line 2: `completion` is no plain text; write the text out"),
        ("name = n()\ncompletion = 'x'\n", "{}, line 1: `name` is no plain text; write the text out"),
        ("completion = " + "-" * 100_000 + "1\n", "{}: is no readable Python; write plain assignments"),
        (b"a = 1\ncompletion = '\xff'\n", "{}, line 2: is no UTF-8 text; save it as UTF-8"),
        (b"#" * 5_000_001, "{}: is larger than 5,000,000 bytes"),
        (
            "completion = '" + "\x01" * 1_000_000 + "'\n",
            "{}: as a row this is longer than 5,000,000 bytes; shorten the program",
        ),
    ],
)
def test_a_wrong_file_gets_a_sentence(tmp_path: Path, content: str | bytes, sentence: str) -> None:
    path = zipped(tmp_path / "a.zip", {"T_0_0.py": FILE, "T_0_1.py": content})
    folder = tmp_path / "folder"
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    assert sentence_about(path).startswith(sentence.format(path / "T_0_1.py"))
    assert sentence_about(folder).startswith(sentence.format(folder / "T_0_1.py"))


def test_two_files_of_one_completion(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.zip", {"a/T_0_1.py": FILE, "b/T_00_01.py": b"\xff"})
    assert (
        sentence_about(path)
        == f"{path}/b/T_00_01.py: T/0/1 stands here again; {path}/a/T_0_1.py holds it already"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        with zipfile.ZipFile(tmp_path / "b.zip", "w") as archive:
            archive.writestr("T_0_1.py", FILE)
            archive.writestr("T_0_1.py", FILE)
    assert "T/0/1 stands here again" in sentence_about(tmp_path / "b.zip")


def test_nothing_that_is_no_completion(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.zip", {"notes.py": FILE, "T_0_0.py/": "", "T_0_9999999999.py": FILE})
    told = "there is no file named TASK_PROMPT_INDEX.py, such as LunchTime_0_1.py, in it"
    assert sentence_about(path) == f"{path}: {told}"


def test_an_encrypted_member(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.zip", {"T_0_0.py": FILE})
    data = bytearray(path.read_bytes())
    data[data.index(b"PK\x01\x02") + 8] |= 1
    path.write_bytes(data)
    assert sentence_about(path) == f"{path}/T_0_0.py: is encrypted; pack it without a password"


@pytest.mark.parametrize("how", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_member_that_cannot_be_unpacked_in_small_pieces(tmp_path: Path, how: int) -> None:
    path = zipped(tmp_path / "a.zip", {"T_0_0.py": FILE + "#" * 100_000_000}, how)
    assert sentence_about(path) == f'{path}/T_0_0.py: is packed in an unusual way; pack it with "deflate"'


@pytest.mark.parametrize("declared", [1, len(FILE) - 1, len(FILE) + 1, 5_000_000, 4_000_000_000])
def test_a_member_that_lies_about_its_size_is_read_whole_or_refused(tmp_path: Path, declared: int) -> None:
    path = zipped(tmp_path / "a.zip", {"T_0_0.py": FILE})
    data = bytearray(path.read_bytes())
    struct.pack_into("<L", data, data.index(b"PK\x01\x02") + 24, declared)
    path.write_bytes(data)
    if declared < len(FILE):
        assert sentence_about(path).startswith(f"{path}: is no readable zip (Bad CRC-32")
    else:
        assert [c.program for c in published_completions(path)] == ["x = 1"]


def test_a_bomb_that_hides_its_size_is_not_unpacked(tmp_path: Path) -> None:
    path = zipped(tmp_path / "a.zip", {"T_0_0.py": FILE + "#" * 300_000_000})
    data = bytearray(path.read_bytes())
    struct.pack_into("<L", data, data.index(b"PK\x01\x02") + 24, 4_000_000_000)
    path.write_bytes(data)
    tracemalloc.start()
    try:
        assert sentence_about(path) == f"{path}/T_0_0.py: is larger than 5,000,000 bytes"
        assert tracemalloc.get_traced_memory()[1] < 25_000_000
    finally:
        tracemalloc.stop()


def test_one_member_at_a_time_is_held(tmp_path: Path) -> None:
    members = {f"T_0_{index}.py": f"completion = '{'#' * 1_000_000}'\n" for index in range(60)}
    path = zipped(tmp_path / "a.zip", members)
    tracemalloc.start()
    try:
        assert sum(1 for _ in published_completions(path)) == 60
        assert tracemalloc.get_traced_memory()[1] < 25_000_000
    finally:
        tracemalloc.stop()


def test_all_members_together_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = zipped(tmp_path / "a.zip", {f"T_0_{index}.py": FILE for index in range(10)})
    monkeypatch.setattr(published, "MAX_UNPACKED", 9 * len(FILE))
    assert sentence_about(path) == f"{path}: unpacks to more than {9 * len(FILE)} bytes"
    monkeypatch.setattr(published, "MAX_UNPACKED", 10 * len(FILE))
    assert sum(1 for _ in published_completions(path)) == 10
    monkeypatch.setattr(published, "MAX_ZIP", path.stat().st_size - 1)
    assert sentence_about(path).endswith(f"is larger than {path.stat().st_size - 1:,} bytes")


def test_odd_escapes_say_nothing_on_the_terminal_and_halves_of_a_pair_are_joined(tmp_path: Path) -> None:
    program = r"completion = '\d \ud83d\ude00 \ud800'" + "\n"
    path = zipped(tmp_path / "a.zip", {"T_0_0.py": program})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert [c.program for c in published_completions(path)] == ["\\d \U0001f600 \ud800"]
