"""A file of lines that somebody else goes on writing: each line of it is read once."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from enum import Enum, auto
from pathlib import Path
from typing import BinaryIO

from codebotler.badinput import BadInput

KEPT = 200
"""Bytes at its beginning, and before the place that was reached, by which a file is known again."""


class Change(Enum):
    """What became of a file since it was read last."""

    NONE = auto()
    MORE = auto()
    ANOTHER = auto()
    """It is gone, or another one stands in its place: what was read from it counts no more."""


class Tail:
    """Reads whole lines, each once; a line without an end is still being written.

    Args:
        path: the file; it need not be there yet.
        within: the folder that it must lie in, whatever links say.
        limit: the longest line in bytes.
    """

    def __init__(self, path: Path, within: Path, limit: int) -> None:
        self.path, self.within, self._limit = path, within, limit
        self.start_over()

    def start_over(self) -> None:
        """Forget what was read."""
        self.offset = self.number = 0
        self.size = 0
        self._known: tuple[int, int] | None = None
        self._changed = 0
        self._at_end = False
        self._first = self._last = b""

    def look(self) -> Change:
        """Say what became of the file, for a few system calls.

        Raises:
            BadInput: something else than a file is there, or it lies elsewhere.
        """
        try:
            found = self.path.stat()
        except OSError:
            return Change.NONE if self._known is None else Change.ANOTHER
        if not stat.S_ISREG(found.st_mode):
            raise BadInput("is no file", file=self.path.name)
        identity = found.st_dev, found.st_ino
        if self._known is not None:
            if identity != self._known or found.st_size < self.offset:
                return Change.ANOTHER
            if found.st_size == self.size:  # whoever only adds lines makes it longer
                same = found.st_mtime_ns == self._changed
                return Change.ANOTHER if not same else Change.MORE if self._stopped else Change.NONE
        with self._opened() as file:
            begins = file.read(len(self._first)) == self._first
            file.seek(max(0, self.offset - len(self._last)))
            if not begins or file.read(len(self._last)) != self._last:
                return Change.ANOTHER
        self._known, self.size, self._changed = identity, found.st_size, found.st_mtime_ns
        self._at_end = False
        return Change.MORE if self.offset < self.size else Change.NONE

    @property
    def _stopped(self) -> bool:
        """Whether the lines that were there when it was last looked at were not all read."""
        return self.offset < self.size and not self._at_end

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """The whole lines that were not read before, with their places in bytes; whoever stops goes on there.

        Raises:
            BadInput: a line is too long; the next ones are read on.
        """
        with self._opened() as file:
            file.seek(self.offset)
            while True:
                line = file.readline(self._limit + 1)
                if not line.endswith(b"\n"):
                    if len(line) > self._limit:
                        self.number += 1
                        self.offset += len(line)
                        raise BadInput(
                            f"this row is longer than {self._limit:,} bytes",
                            file=self.path.name,
                            line=self.number,
                        )
                    self._at_end = True
                    return
                at = self.offset
                self.number += 1
                self.offset += len(line)
                self._first, self._last = self._first or line[:KEPT], line[-KEPT:]
                yield at, line

    def at(self, place: int, size: int) -> bytes:
        """Read a line again.

        Raises:
            BadInput: the file is gone.
        """
        with self._opened() as file:
            file.seek(place)
            return file.read(size)

    def _opened(self) -> BinaryIO:
        try:
            inside = self.path.resolve(strict=True).is_relative_to(self.within)
            if inside:
                # A pipe that took the file's place would be waited for, but for this flag.
                return os.fdopen(os.open(self.path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK), "rb")
        except OSError as error:
            raise BadInput(f"cannot be read ({error.strerror})", file=self.path.name) from None
        raise BadInput("leads out of the folder of runs, where nothing is read", file=self.path.name)
