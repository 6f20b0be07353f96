"""A file that grows: each line is read once, and what takes its place is noticed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from codebotler.badinput import BadInput
from roboeval.web.tail import Change, Tail


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "rows.jsonl"


def tail_of(path: Path, limit: int = 1000) -> Tail:
    return Tail(path, path.parent.resolve(), limit)


def read(tail: Tail) -> list[bytes]:
    """What is new, in the way in which it is meant to be read."""
    if tail.look() is Change.ANOTHER:
        tail.start_over()
        tail.look()
    return [line for _, line in tail.lines()] if tail.path.exists() else []


def test_each_line_is_read_once(path: Path) -> None:
    tail = tail_of(path)
    assert tail.look() is Change.NONE
    path.write_bytes(b"one\ntwo\n")
    assert read(tail) == [b"one\n", b"two\n"]
    assert tail.look() is Change.NONE
    with path.open("ab") as file:
        file.write(b"three\nfo")
    assert read(tail) == [b"three\n"]
    assert tail.look() is Change.NONE
    with path.open("ab") as file:
        file.write(b"ur\n")
    assert read(tail) == [b"four\n"]
    assert tail.number == 4


def test_whoever_stops_in_the_middle_goes_on_there(path: Path) -> None:
    path.write_bytes(b"one\ntwo\nthree\n")
    tail = tail_of(path)
    assert tail.look() is Change.MORE
    assert next(tail.lines()) == (0, b"one\n")
    assert tail.look() is Change.MORE
    assert list(tail.lines()) == [(4, b"two\n"), (8, b"three\n")]
    assert tail.at(4, 4) == b"two\n"


@pytest.mark.parametrize(
    "content", [b"other\nlines\n", b"one\n", b"uno\ntwo\nand more\n", b"", b"one\nTWO\n"], ids=str
)
def test_another_file_in_its_place_is_noticed(path: Path, content: bytes) -> None:
    path.write_bytes(b"one\ntwo\n")
    tail = tail_of(path)
    assert read(tail) == [b"one\n", b"two\n"]
    os.utime(path, ns=(0, 0))
    tail.start_over()
    read(tail)
    path.write_bytes(content)
    assert tail.look() is Change.ANOTHER


def test_a_file_that_was_replaced_by_a_longer_one_is_noticed(path: Path) -> None:
    path.write_bytes(b"one\ntwo\n")
    tail = tail_of(path)
    read(tail)
    other = path.with_name("other")
    other.write_bytes(b"one\ntwo\nthree\n")
    other.replace(path)
    assert tail.look() is Change.ANOTHER


def test_a_file_that_is_gone_is_noticed(path: Path) -> None:
    path.write_bytes(b"one\n")
    tail = tail_of(path)
    read(tail)
    path.unlink()
    assert tail.look() is Change.ANOTHER


def test_a_line_that_is_too_long_is_an_error_and_the_next_ones_are_read(path: Path) -> None:
    path.write_bytes(b"x" * 1001 + b"\nshort\n")
    tail = tail_of(path)
    tail.look()
    with pytest.raises(BadInput, match="1,000 bytes") as error:
        list(tail.lines())
    assert (str(error.value.file), error.value.line) == ("rows.jsonl", 1)
    assert list(tail.lines())[-1][1] == b"short\n"


def test_links_that_lead_out_are_not_followed(path: Path) -> None:
    inside = path.parent / "inside"
    inside.mkdir()
    path.write_bytes(b"secret\n")
    link = inside / "rows.jsonl"
    link.symlink_to(path)
    tail = Tail(link, inside.resolve(), 1000)
    with pytest.raises(BadInput, match="leads out"):
        tail.look()


def test_what_is_no_file_is_not_waited_for(path: Path) -> None:
    os.mkfifo(path)
    with pytest.raises(BadInput, match="no file"):
        tail_of(path).look()
