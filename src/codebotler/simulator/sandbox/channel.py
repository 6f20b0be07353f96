"""Talks to the engine over a socket: sends JSON, and receives Python's `marshal` format.

Only messages from the engine are ever unmarshalled. Changes that a program makes to `json`, `os` or the
builtins have no effect here, since this module holds its own references.
"""

from __future__ import annotations

import builtins
from marshal import loads
from posix import _exit, read, write

from codebotler.simulator.sandbox import CHANNEL, HEADER, MAX_FRAME

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

# This module's own copy of the builtins, which a program cannot change.
__builtins__ = dict(vars(builtins))  # type: ignore[assignment]  # Python also accepts a dict

TOO_LONG_REQUEST = '["too-long",[],0.0]'


def send(text: str) -> None:
    """Send one JSON message in ASCII. If it is too long, send a request to end the run instead."""
    if len(text) > MAX_FRAME:
        text = TOO_LONG_REQUEST
    send_frames([text.encode("ascii")])


def send_frames(frames: list[bytes]) -> None:
    """Send several messages at once, each preceded by its length."""
    data = b"".join([len(frame).to_bytes(HEADER, "big") + frame for frame in frames])
    written = write(CHANNEL, data)
    while written < len(data):
        data = data[written:]
        written = write(CHANNEL, data)


def receive() -> Any:  # noqa: ANN401 - any message from the engine
    """Return the engine's next message. Exit the process if the engine has ended."""
    missing = int.from_bytes(_read(HEADER), "big")
    pieces = []
    while missing > 0:  # more than once on macOS only; see `channel_pair`
        pieces.append(_read(missing))
        missing -= len(pieces[-1])
    return loads(b"".join(pieces))  # noqa: S302 - written by the engine


def _read(most: int) -> bytes:
    """Read a part of the engine's message, or exit the process if the engine has ended."""
    piece = read(CHANNEL, most)
    if not piece:
        _exit(1)
    return piece
