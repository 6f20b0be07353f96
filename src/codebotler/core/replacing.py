"""Which files a command may write over: those that such a command wrote, and nobody's work."""

from __future__ import annotations

from pathlib import Path

from codebotler.core.errors import UserError


def expect_replaceable(path: Path, *beginnings: bytes) -> None:
    """Take a file that is not there, is empty, is no file, such as a pipe, or begins as the new one may.

    Args:
        path: the file.
        beginnings: what files of its kind begin with.

    Raises:
        UserError: it holds something else.
        OSError: it cannot be read.
    """
    if not path.is_file():
        return
    with path.open("rb") as file:
        start = file.read(max(map(len, beginnings)))
    if start and not start.startswith(beginnings):
        raise UserError("this file holds something else; name another one, or remove it", file=path)
