"""Cancels the goal of a robot behind a rosbridge when the tool that sent it was killed.

It is a process that outlives the tool. The first line of its input names the rosbridge; each further one
is what is to be said there if the input ends now, and empty while nothing goes on.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from collections.abc import Sequence
from typing import Any

TIMES, PAUSE = 10, 0.1  # what is said first may be said before the server listens
CLOSES = 1.0  # seconds that the other side may take to say good-bye


def insist(address: str, messages: Sequence[dict[str, Any]], patience: float) -> None:
    """Say something over a connection of its own, and repeat the last of it for a second.

    Args:
        address: of the rosbridge.
        messages: what is said, in order; at least one.
        patience: seconds that the connection may take.

    Raises:
        OSError: nobody answers there, or not any more.
    """
    from websockets.exceptions import WebSocketException  # noqa: PLC0415 - start-up counts
    from websockets.sync.client import connect  # noqa: PLC0415 - the same

    texts = [json.dumps(message) for message in messages]
    try:
        with connect(address, open_timeout=patience, close_timeout=CLOSES) as line:
            for text in texts:
                line.send(text)
            for _ in range(TIMES):
                time.sleep(PAUSE)
                line.send(texts[-1])
    except (ValueError, WebSocketException) as error:
        raise OSError(str(error)) from error


def main() -> None:
    """Wait for the end of the input, and say what is to be said then."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    lines = map(json.loads, sys.stdin)
    start = next(lines)
    print(json.dumps({"is": "ready"}), flush=True)  # noqa: T201 - so it speaks
    last: list[dict[str, Any]] = []
    for line in lines:
        last = line["say"]
    until = time.monotonic() + start["patience"]
    while last and time.monotonic() < until:
        try:
            insist(start["address"], last, start["patience"])
            break
        except OSError:
            time.sleep(PAUSE)


if __name__ == "__main__":
    main()
