"""Files that no crash leaves half-written: JSON lines that only grow, and files that are replaced whole."""

from __future__ import annotations

import contextlib
import errno
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path
from typing import Any, BinaryIO

from codebotler.core.errors import UserError

MAX_ROW = 5_000_000
CANNOT_SYNC = (errno.EINVAL, errno.ENOTSUP)  # says a file system that brings no folder to the disk


# --- JSON lines


def read_lines(
    path: Path, *, limit: int = MAX_ROW, name: Path | str | None = None
) -> Iterator[tuple[int, bytes]]:
    """Read a file line by line: the line's number, counted from 1, and its bytes.

    Args:
        path: the file.
        limit: the longest line in bytes.
        name: what sentences call the file; its path by default.

    Raises:
        UserError: the file is missing, or a line is too long.
    """
    name = name or path
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise UserError("there is no such file", file=name) from None
    except OSError as error:
        raise UserError(f"cannot be read ({error.strerror})", file=name) from None
    with file:
        for number in count(1):
            line = file.readline(limit + 1)
            if not line:
                return
            if len(line) > limit:
                raise UserError(f"this row is longer than {limit:,} bytes", file=name, line=number)
            yield number, line


def read_rows(
    path: Path,
    *,
    growing: bool = False,
    name: Path | str | None = None,
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Read a file of JSON lines: the line's number, counted from 1, and its object.

    Args:
        path: the file.
        growing: whether it is one that we write: then a broken last line without an end was torn by a crash,
            and is passed over.
        name: what sentences call the file; its path by default.

    Raises:
        UserError: the file is missing, or a line is too long or no JSON object.
    """
    name = name or path
    for number, line in read_lines(path, name=name):
        if line.strip():
            try:
                row = parsed_row(line)
            except UserError as error:
                raise UserError(error.sentence, file=name, line=number) from None
            if row is None and growing and not line.endswith(b"\n"):
                return
            if row is None:
                raise UserError("this line is no JSON", file=name, line=number)
            yield number, row


def parsed_row(line: bytes, example: str | None = None) -> dict[str, Any] | None:
    """The JSON object that a line says; None if it is no JSON.

    Raises:
        UserError: it is JSON, but no object.
    """
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(row, dict):
        mend = "" if example is None else f"; a row looks like {example}"
        raise UserError(f"this line is no JSON object{mend}")
    return row


def to_line(row: object) -> bytes:
    """A row, or a part of one, as a line of JSON, in UTF-8."""
    # Half of a surrogate pair, which UTF-8 cannot hold, becomes an escape, which JSON reads.
    return json.dumps(row, ensure_ascii=False).encode(errors="backslashreplace") + b"\n"


@dataclass
class Appender:
    """Appends whole lines to a file; what a crash leaves torn is cut off when it is opened.

    Args:
        path: the file.
    """

    path: Path

    def __post_init__(self) -> None:
        is_new = not self.path.exists()
        self._file: BinaryIO = self.path.open("ab", buffering=0)
        if is_new:
            sync_folder(self.path.parent)
        whole = whole_length(self.path)
        if self.path.stat().st_size > whole:
            self._file.truncate(whole)

    def append(self, line: bytes) -> None:
        """Add a line, whole or not at all.

        Raises:
            OSError: the disk is full; nothing of the line stays.
        """
        start = self._file.seek(0, os.SEEK_END)
        view = memoryview(line)
        try:
            while view:
                view = view[self._file.write(view) :]
        except OSError as error:
            self._file.truncate(start)
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def cut(self, length: int) -> None:
        """Drop what stands after so many bytes."""
        if self.path.stat().st_size > length:
            self._file.truncate(length)

    def sync(self) -> None:
        """Bring everything to the disk; may be called from another thread.

        Raises:
            OSError: that is not possible.
        """
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.path)) from None

    def close(self) -> None:
        """Bring everything to the disk, and let go of the file."""
        with self._file:
            self.sync()


def sync_folder(folder: Path) -> None:
    """Bring to the disk which files a folder has, as far as its file system can.

    Else a file whose content is on the disk may be gone after a power failure.

    Raises:
        OSError: the disk is broken.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except PermissionError:  # a folder that may be written but not read
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in CANNOT_SYNC:
            raise OSError(error.errno, error.strerror, str(folder)) from None
    finally:
        os.close(descriptor)


def whole_length(path: Path) -> int:
    """How many bytes of a file of lines are whole lines."""
    with path.open("rb") as file:
        position = file.seek(0, os.SEEK_END)
        while position > 0:
            start = max(0, position - (1 << 16))
            file.seek(start)
            end = file.read(position - start).rfind(b"\n")
            if end >= 0:
                return start + end + 1
            position = start
    return 0


def length_before(path: Path, line: int) -> int:
    """How many bytes of a file stand before a line, counted from 1."""
    with path.open("rb") as file:
        return sum(map(len, islice(file, line - 1)))


# --- whole files


def write_whole(path: Path, content: bytes | memoryview) -> None:
    """Write a file so that it is there whole or as it was."""
    with written_whole(path) as file:
        file.write(content)


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[BinaryIO]:
    """A file to write to, which takes its place when all is written; else what stood there stays."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(path.name + ".new")
    try:
        with temporary.open("wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def to_text(data: dict[str, Any]) -> bytes:
    """A JSON file for people to read."""
    return json.dumps(data, indent=2, ensure_ascii=False).encode() + b"\n"
