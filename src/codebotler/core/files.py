"""Read files with clear errors, append to logs safely, replace files atomically, find the state folder."""

from __future__ import annotations

import codecs
import errno
import fcntl
import io
import json
import mmap
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path
from typing import Any, BinaryIO

from codebotler.core.errors import UserError

SYNC_UNSUPPORTED = (errno.EINVAL, errno.ENOTSUP)  # raised by file systems that cannot sync folders

MAX_FILE_BYTES = 5_000_000
MAX_ROW = 5_000_000


# --- whole texts


def read_text(path: Path, *, limit: int = MAX_FILE_BYTES) -> str:
    """Read a UTF-8 file. Raise UserError if it is not readable, not UTF-8, or longer than `limit` bytes."""
    return decode_text(read_bytes(path, limit + 1), path, limit=limit)


def read_bytes(path: Path, most: int) -> bytes:
    """Read at most `most` bytes from the start of a file, or raise UserError if it cannot be read."""
    with _open(path) as file:
        return file.read(most)


def decode_text(data: bytes, name: Path | str, *, limit: int = MAX_FILE_BYTES) -> str:
    """Decode UTF-8, normalize line endings and drop a byte order mark.

    Raise UserError about the file `name` if the text is not UTF-8 or is longer than `limit` bytes.
    """
    if len(data) > limit:
        raise UserError(f"the text is larger than {limit:,} bytes; shorten it", file=name)
    _expect_not_utf_16(data, name)
    try:
        return io.StringIO(data.decode("utf-8-sig"), newline=None).read()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise UserError("the text is not UTF-8; save it as UTF-8", file=name, line=line) from None


def _expect_not_utf_16(data: bytes, name: Path | str) -> None:
    """Reject text with the byte order mark of UTF-16, which editors on Windows call Unicode."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise UserError("the text is UTF-16; save it as UTF-8", file=name)


@contextmanager
def _open(path: Path) -> Iterator[BinaryIO]:
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise UserError(f"the file cannot be read ({error.strerror})", file=path) from None


# --- JSON lines


def read_lines(path: Path, *, limit: int = MAX_ROW) -> Iterator[tuple[int, bytes]]:
    """Yield the lines of a file, numbered from 1. Raise UserError if a line is longer than `limit` bytes."""
    with _open(path) as file:
        for number in count(1):
            line = file.readline(limit + 1)
            if not line:
                return
            if number == 1:
                _expect_not_utf_16(line, path)
            if len(line) > limit:
                raise UserError(f"this row is longer than {limit:,} bytes", file=path, line=number)
            yield number, line


def read_rows(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the line number and data of each row of a JSON Lines file, without a partial last row."""
    for number, line in read_lines(path):
        if line.strip():
            try:
                row = parse_row(line)
            except UserError as error:
                raise UserError(error.sentence, file=path, line=number) from None
            if row is None and not line.endswith(b"\n"):
                return
            if row is None:
                raise UserError("this line is not JSON; correct or remove it", file=path, line=number)
            yield number, row


def parse_row(line: bytes, example: str | None = None) -> dict[str, Any] | None:
    """Return the JSON object in a line, or None if the line is not JSON.

    Raise UserError for other JSON, such as a list. The message shows `example`, a correct row, if given.
    """
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(row, dict):
        mend = "" if example is None else f"; a row looks like {example}"
        raise UserError(f"this line is not a JSON object{mend}")
    return row


def to_line(row: object) -> bytes:
    """Encode a row as a line of JSON in UTF-8. Lone surrogates, which are not valid UTF-8, become escapes."""
    return json.dumps(row, ensure_ascii=False).encode(errors="backslashreplace") + b"\n"


def to_text(data: dict[str, Any]) -> bytes:
    """Encode data as indented JSON in UTF-8, for files that people read."""
    return json.dumps(data, indent=2, ensure_ascii=False).encode() + b"\n"


class Appender:
    """Appends lines to a file, after removing a partial last line that a crash may have left behind.

    With `exclusive`, opening raises BlockingIOError if another process has locked the file.
    """

    def __init__(self, path: Path, *, exclusive: bool = False) -> None:
        self.path = path
        is_new = not path.exists()
        self._file: BinaryIO = path.open("ab", buffering=0)
        try:
            if exclusive:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if is_new:
                sync_folder(path.parent)
            self._is_file = path.is_file()  # rather than a device or a pipe
            if self._is_file and (whole := _intact_length(path)) < path.stat().st_size:
                self._file.truncate(whole)
        except BaseException:
            self._file.close()
            raise

    def append(self, line: bytes) -> None:
        """Append a line, with its line break, completely or not at all. Raise OSError if the disk is full."""
        descriptor = self._file.fileno()
        start = os.fstat(descriptor).st_size
        with name_in_errors(self.path):
            try:
                while line:
                    line = line[os.write(descriptor, line) :]
            except OSError:
                with suppress(OSError):  # a device cannot be truncated
                    self._file.truncate(start)
                raise

    def sync(self) -> None:
        """Flush the file to the disk. Other threads may call this method."""
        if self._is_file:
            with name_in_errors(self.path):
                os.fsync(self._file.fileno())

    def close(self) -> None:
        """Flush the file to the disk and close it."""
        with self._file:
            self.sync()


def _intact_length(path: Path) -> int:
    with path.open("rb") as file:
        if not os.fstat(file.fileno()).st_size:
            return 0
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            return content.rfind(b"\n") + 1


# --- writing


@contextmanager
def name_in_errors(path: Path) -> Iterator[None]:
    """In a `with` block, make each OSError name the file, since Python often leaves the name out."""
    try:
        yield
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from None


def write_whole(path: Path, content: bytes | memoryview) -> None:
    """Replace a file atomically: after a crash, it has either its old or its new content."""
    with open_replacement(path) as file:
        file.write(content)


@contextmanager
def open_replacement(path: Path, temporary: Path | None = None) -> Iterator[BinaryIO]:
    """Open a temporary file that replaces `path` if the `with` block ends without an error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary or path.with_name(path.name + ".new")
    try:
        with name_in_errors(path):
            with temporary.open("wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Flush a folder to the disk, so that a new file in it survives a power failure."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except PermissionError:  # the folder is writable but not readable
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in SYNC_UNSUPPORTED:
            raise OSError(error.errno, error.strerror, str(folder)) from None
    finally:
        os.close(descriptor)


def expect_replaceable(path: Path, *beginnings: bytes) -> None:
    """Raise UserError if a file starts with none of `beginnings`, so that we overwrite only our own files."""
    if path.is_file():
        with path.open("rb") as file:
            start = file.read(max(map(len, beginnings)))
        if start and not start.startswith(beginnings):
            raise UserError("this file has unexpected content and is kept; remove or rename it", file=path)


# --- the state folder


def home() -> Path:
    """Return the folder for missions, such as `~/.local/state/codebotler`. It may not exist yet."""
    folder = _user_folder("XDG_STATE_HOME", ".local/state")
    if folder is None:
        raise UserError("you have no home folder; set CODEBOTLER_HOME to a folder")
    return folder


def config_file() -> Path | None:
    """Return the path of `config.yaml`, even if there is no such file, or None without a home folder."""
    folder = _user_folder("XDG_CONFIG_HOME", ".config")
    return None if folder is None else folder / "config.yaml"


def _user_folder(variable: str, default: str) -> Path | None:
    if ours := os.environ.get("CODEBOTLER_HOME"):
        return Path(ours).absolute()
    base = os.environ.get(variable)
    try:
        return (Path(base) if base else Path.home() / default) / "codebotler"
    except RuntimeError:  # the user has no home folder, which is common in containers
        return None


def make_folder(folder: Path) -> None:
    """Create a folder if it is missing. Raise UserError if nothing can be written into the folder."""
    with suppress(PermissionError):
        folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK | os.X_OK, effective_ids=True):
        raise UserError("this folder is not writable; set CODEBOTLER_HOME to another folder", file=folder)
