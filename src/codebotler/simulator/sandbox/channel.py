"""The line between a child and the engine: frames of four bytes of length; JSON goes out, marshal comes in.

Only what the engine has written is ever unmarshalled. What a program does to `json`, `os` or the builtins is
not felt here: all that is needed is held under names of our own.
"""

from __future__ import annotations

import builtins
from marshal import loads
from posix import _exit, read, write

from codebotler.simulator.sandbox import CHANNEL, HEADER, MAX_FRAME

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

__builtins__ = dict(vars(builtins))  # type: ignore[assignment]  # functions below look here for `len`, not where a program can write

AT_ONCE = 16_384  # bytes that are read at a time: a larger buffer would touch more of the memory
TOO_LONG = '["too-long",[],0.0,1]'


def send(text: str) -> None:
    """Write one frame of JSON, which is ASCII."""
    if len(text) > MAX_FRAME:
        text = TOO_LONG
    send_bytes(text.encode("ascii"))


def send_bytes(data: bytes) -> None:
    """Write one frame."""
    data = len(data).to_bytes(HEADER, "big") + data
    written = write(CHANNEL, data)
    while written < len(data):
        data = data[written:]
        written = write(CHANNEL, data)


def receive() -> Any:  # noqa: ANN401 - whatever the engine says
    """Read one frame; without an engine there is no reason to go on."""
    data = b""
    while len(data) < HEADER or len(data) < HEADER + int.from_bytes(data[:HEADER], "big"):
        piece = read(CHANNEL, AT_ONCE)
        if not piece:
            _exit(1)
        data += piece
    return loads(data[HEADER:])  # noqa: S302 - written by the engine
