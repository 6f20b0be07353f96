"""Store the pictures of a mission, each in its own file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from codebotler.core.files import write_whole

PICTURE_FOLDER = "pictures"
MAX_STORED_PICTURE_BYTES = 2_000_000
MAX_MISSION_PICTURE_BYTES = 200_000_000
_SIGNATURES: Mapping[str, bytes] = {"jpg": b"\xff\xd8\xff", "png": b"\x89PNG\r\n\x1a\n"}
"""The first bytes of each file format."""
_PICTURE_PATH = re.compile(rf"{PICTURE_FOLDER}/\d+\.(?:{'|'.join(_SIGNATURES)})")


class PictureStore:
    """Stores the pictures of one mission as files in its folder, without converting them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._count = self._bytes = 0

    def keep(self, data: bytes) -> dict[str, str]:
        """Store a picture. Return `{"file": path}` for the event, or `{"text": why}` if it was not stored."""
        kind = next((kind for kind, start in _SIGNATURES.items() if data.startswith(start)), None)
        if kind is None:
            return _explain_loss(f"its {len(data):,} bytes are neither JPEG nor PNG")
        if len(data) > MAX_STORED_PICTURE_BYTES:
            return _explain_loss(f"its {len(data):,} bytes exceed the limit of {MAX_STORED_PICTURE_BYTES:,}")
        if self._bytes + len(data) > MAX_MISSION_PICTURE_BYTES:
            return _explain_loss(f"all pictures of a mission may have {MAX_MISSION_PICTURE_BYTES:,} bytes")
        name = f"{PICTURE_FOLDER}/{self._count + 1}.{kind}"
        write_whole(self._folder / name, data)
        self._count += 1
        self._bytes += len(data)
        return {"file": name}


def _explain_loss(why: str) -> dict[str, str]:
    return {"text": f"a picture was not stored: {why}"}


def read_picture(folder: Path, line: Mapping[str, Any]) -> tuple[str, bytes] | None:
    """Return the extension, such as `jpg`, and the bytes of an event's picture; None if there is none."""
    name = line.get("file")
    if line["event"] != "picture" or not isinstance(name, str) or not _PICTURE_PATH.fullmatch(name):
        return None
    try:
        return name.rpartition(".")[2], (folder / name).read_bytes()
    except OSError:
        return None
