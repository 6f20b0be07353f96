"""Cancels the goal of a robot behind a rosbridge when the tool that sent it was killed.

It is a process that outlives the tool. The first line of its input names the rosbridge and what is said there
first; each further one is what is to be said if the input ends now, and null while nothing goes on.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from typing import Any, TypeAlias

from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect

Message: TypeAlias = Mapping[str, Any]

INSISTS, PAUSE = 3.0, 0.1  # seconds; what is said first may be said before the server listens
OPENS = 5.0  # seconds that a rosbridge may take to answer
CLOSES = 1.0  # seconds that it may take to say good-bye
FAULTS = (OSError, ValueError, WebSocketException)


class Voice:
    """Speaks with a rosbridge over a connection of its own, and opens another one if that is lost.

    Args:
        address: of the rosbridge.
        opening: what is said there first.
    """

    def __init__(self, address: str, opening: Sequence[Message]) -> None:
        self._address, self._opening = address, opening
        self._opened = ExitStack()
        self._connection: ClientConnection | None = None

    def say(self, message: Message) -> bool:
        """Say something, and tell whether it could be said."""
        try:
            self.open()
            assert self._connection is not None
            self._connection.send(json.dumps(message))
        except FAULTS:
            self.close()
            return False
        return True

    def insist(self, message: Message) -> bool:
        """Say it again and again for a while, and tell whether it could be said at all."""
        until, is_said = time.monotonic() + INSISTS, False
        while time.monotonic() < until:
            is_said = self.say(message) or is_said
            time.sleep(PAUSE)
        return is_said

    def open(self) -> None:
        """Connect, unless it is connected.

        Raises:
            OSError, ValueError, WebSocketException: nobody answers there.
        """
        if self._connection is None:
            opening = connect(self._address, open_timeout=OPENS, close_timeout=CLOSES)
            self._connection = self._opened.enter_context(opening)
            for message in self._opening:
                self._connection.send(json.dumps(message))

    def close(self) -> None:
        """Connect no more."""
        self._connection = None
        self._opened.close()


def main() -> None:
    """Watch over a tool until its end."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    start = json.loads(sys.stdin.readline())
    print(json.dumps({"is": "ready"}), flush=True)  # noqa: T201 - so it speaks
    voice, last = Voice(start["address"], start["opening"]), None
    with suppress(*FAULTS):  # it is tried again when there is something to say
        voice.open()
    for line in sys.stdin:
        last = json.loads(line)["say"]
    if last is not None:
        voice.insist(last)
    voice.close()


if __name__ == "__main__":
    main()
