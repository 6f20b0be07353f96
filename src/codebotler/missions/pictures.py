"""The pictures of a mission, each in a file of its own."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from codebotler.core.files import write_whole

FOLDER = "pictures"
MOST_BYTES = 2_000_000  # of one picture
MOST_IN_ALL = 200_000_000  # bytes of all pictures of a mission
KINDS: Mapping[str, bytes] = {"jpg": b"\xff\xd8\xff", "png": b"\x89PNG\r\n\x1a\n"}
"""The first bytes of each kind of file."""
NAME = re.compile(rf"{FOLDER}/\d+\.(?:{'|'.join(KINDS)})")


class Pictures:
    """Keeps the pictures of a mission as they came; only their first bytes are read."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._count = self._bytes = 0

    def keep(self, data: bytes) -> dict[str, str]:
        """Write a picture, and return its event's `file`, or a `text` that says why it was not kept."""
        kind = next((kind for kind, start in KINDS.items() if data.startswith(start)), None)
        if kind is None:
            return _left_out(f"its {len(data):,} bytes are neither JPEG nor PNG")
        if len(data) > MOST_BYTES:
            return _left_out(f"it has {len(data):,} bytes; at most {MOST_BYTES:,} are allowed")
        if self._bytes + len(data) > MOST_IN_ALL:
            return _left_out(f"a mission keeps at most {MOST_IN_ALL:,} bytes of pictures")
        name = f"{FOLDER}/{self._count + 1}.{kind}"
        path = self._folder / name
        write_whole(path, data)
        self._count += 1
        self._bytes += len(data)
        return {"file": name}


def _left_out(why: str) -> dict[str, str]:
    return {"text": f"a picture was not kept: {why}"}


def picture_of(folder: Path, line: Mapping[str, Any]) -> tuple[str, bytes] | None:
    """The kind and the bytes of an event's picture, if there is one."""
    name = line.get("file")
    if line["event"] != "picture" or not isinstance(name, str) or not NAME.fullmatch(name):
        return None
    try:
        return name.rpartition(".")[2], (folder / name).read_bytes()
    except OSError:
        return None
