"""Which requests were under way when a run was interrupted, since a model may be paid twice for those."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Self

from codebotler.badinput import BadInput
from codebotler.files import Appender, read_rows, to_line, write_whole
from roboeval.evaluation.completions import Key


class InFlight:
    """The file that notes each request before it is sent, and each that ended without a reply.

    A request that is noted and has neither ended nor left a completion was under way when the run was
    interrupted. The first line counts those of earlier interruptions, so that reading the file twice counts
    nothing twice.

    Args:
        path: the file; it is there only while the run is written, and after an interruption.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lost = 0
        self._file: Appender | None = None
        self._open: dict[Key, None] = {}

    def read(self, done: set[Key], lost_before: int) -> int:
        """Say how many requests were under way at the last interruption, and add them to `lost`.

        Args:
            done: the completions that there are.
            lost_before: how many were under way at interruptions that run.json knows of.

        Raises:
            OSError: the file cannot be written.
            BadInput: somebody has broken it.
        """
        before, under_way = self._read()
        found = len(under_way - done)
        self.lost = max(lost_before, before + found)
        return found

    def clear(self) -> Self:
        """Forget what the file noted, once `lost` is recorded, and be ready to note.

        Raises:
            OSError: the file cannot be written.
        """
        write_whole(self.path, to_line({"lost": self.lost}))
        self._file = Appender(self.path)
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if self._file is not None:
            with contextlib.suppress(OSError):  # of a full disk has been told
                self._file.close()
        if kind is None and not self._open:
            self.path.unlink(missing_ok=True)

    def __len__(self) -> int:
        return len(self._open)

    def sent(self, key: Key) -> None:
        """Note a request that is about to be sent.

        Raises:
            OSError: the disk is full; nothing must be sent then.
        """
        self._note("sent", key)
        self._open[key] = None

    def failed(self, key: Key) -> None:
        """Note that a request ended without a reply."""
        self._open.pop(key, None)
        self._note("failed", key)

    def kept(self, key: Key) -> None:
        """Take notice that a reply is among the completions, which is note enough."""
        self._open.pop(key, None)

    def _note(self, what: str, key: Key) -> None:
        if self._file is not None:
            self._file.append(to_line({what: list(key)}))

    def _read(self) -> tuple[int, set[Key]]:
        """How many were lost at earlier interruptions, and which requests were under way at the last one."""
        lost = 0
        under_way: set[Key] = set()
        if not self.path.exists():
            return lost, under_way
        for number, row in read_rows(self.path, growing=True):
            match row:
                case {"lost": int(lost)}:
                    pass
                case {"sent": [str(task), int(prompt), int(index)]}:
                    under_way.add((task, prompt, index))
                case {"failed": [str(task), int(prompt), int(index)]}:
                    under_way.discard((task, prompt, index))
                case _:
                    raise BadInput("this line notes no request; delete the file", file=self.path, line=number)
        return lost, under_way
