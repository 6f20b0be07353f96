"""Cancels the goal of a tool that was killed: a process of its own, which notices that its input has ended.

The first line of its input says where the rosbridge is and what is said there first; each other line, what is
to be said if it is the last one.
"""

from __future__ import annotations

import json
import sys
import time
from contextlib import suppress
from typing import Any

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

TIMES = 15  # a cancel is said, since a connection may just be lost, or not yet lead to the server
PAUSE = 0.2  # seconds between them
OPENS = 5.0  # seconds that a rosbridge may take to answer
FAULTS = (OSError, ValueError, WebSocketException)


def opened(start: dict[str, Any]) -> ClientConnection:
    """A connection with the rosbridge, ready to be spoken on."""
    connection = connect(start["address"], open_timeout=OPENS, close_timeout=1.0, max_size=None)
    for message in start["opening"]:
        connection.send(json.dumps(message))
    return connection


def say(connection: ClientConnection | None, start: dict[str, Any], message: dict[str, Any]) -> None:
    """Say a message several times, over another connection where one is lost."""
    for _ in range(TIMES):
        with suppress(*FAULTS):
            try:
                connection = connection or opened(start)
                connection.send(json.dumps(message))
            except FAULTS:
                connection = None
                raise
        time.sleep(PAUSE)


def main() -> None:
    """Watch over a tool until its end."""
    start = json.loads(sys.stdin.readline())
    connection, last = None, None
    with suppress(*FAULTS):
        connection = opened(start)
    for line in sys.stdin:
        last = json.loads(line)
    if last is not None:
        say(connection, start, last)
    with suppress(*FAULTS):
        if connection is not None:
            connection.close()


if __name__ == "__main__":
    main()
