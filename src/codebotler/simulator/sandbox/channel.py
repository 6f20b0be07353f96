"""The socket between an isolated process and the engine: JSON goes out, Python's `marshal` comes in.

Only what the engine has written is ever unmarshalled. Nothing that a program does to `json`, `os` or the
builtins is felt here: all that is needed is held under names of our own.
"""

from __future__ import annotations

import builtins
from marshal import loads
from posix import _exit, read, write

from codebotler.simulator.sandbox import CHANNEL, HEADER, MAX_FRAME, MORE, PIECE

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

# Functions below look here for `len` and the like, and not where a program can write.
__builtins__ = dict(vars(builtins))  # type: ignore[assignment]  # a dict will do as well as a module

TOO_LONG_REQUEST = '["too-long",[],0.0]'


def send(text: str) -> None:
    """Write one frame of JSON, which is ASCII."""
    if len(text) > MAX_FRAME:
        text = TOO_LONG_REQUEST
    send_bytes(text.encode("ascii"))


def send_bytes(data: bytes) -> None:
    """Write one frame."""
    send_frames([data])


def send_frames(frames: list[bytes]) -> None:
    """Write frames at once."""
    data = b"".join([len(frame).to_bytes(HEADER, "big") + frame for frame in frames])
    written = write(CHANNEL, data)
    while written < len(data):
        data = data[written:]
        written = write(CHANNEL, data)


def receive() -> Any:  # noqa: ANN401 - whatever the engine sends
    """Read one message, piece by piece."""
    pieces = [read_piece()]
    missing = HEADER + int.from_bytes(pieces[0][:HEADER], "big") - len(pieces[0])
    while missing > 0:
        send(f'"{MORE}"')
        pieces.append(read_piece())
        missing -= len(pieces[-1])
    return loads(b"".join(pieces)[HEADER:])  # noqa: S302 - written by the engine


def receive_at_once() -> Any:  # noqa: ANN401 - the same
    """Read one message that does not come in pieces."""
    missing = int.from_bytes(read_piece(HEADER), "big")
    pieces = []
    while missing > 0:
        pieces.append(read_piece(missing))
        missing -= len(pieces[-1])
    return loads(b"".join(pieces))  # noqa: S302 - the same


def read_piece(most: int = PIECE) -> bytes:
    """Read what the engine has sent; without an engine, end."""
    piece = read(CHANNEL, most)
    if not piece:
        _exit(1)
    return piece
