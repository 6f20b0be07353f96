"""Exchange lines of JSON with CodeBotler, and run the main loop of a worker."""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import IO, Any, Dict

Fields = Dict[str, Any]
WRITE_SECONDS = 1.0  # the time limit for writing the last lines


class SetupError(Exception):
    """Raised when the robot cannot be used. The text says why, and how to fix the problem."""


class Channel:
    """Exchanges JSON lines with CodeBotler on standard input and output. `print` writes to standard error."""

    def __init__(self) -> None:
        self._out = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)
        self._in: IO[str] = os.fdopen(os.dup(0), "r", encoding="utf-8")
        # Write in a thread, because a suspended CodeBotler does not read, and a stop must not block.
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._writer = threading.Thread(target=self._write, daemon=True)
        self._writer.start()
        self.last_alive = float("inf")  # when the last line arrived; infinite while the line is handled

    def send(self, kind: str, **more: Any) -> None:
        """Queue a message of a kind such as `ready`, with more fields. It is lost if CodeBotler has died."""
        self._lines.put(json.dumps({"is": kind, **more}, default=str) + "\n")

    def finish(self) -> None:
        """Wait up to 1 second for all queued messages to be written."""
        self._lines.put(None)
        self._writer.join(WRITE_SECONDS)

    def lines(self) -> Iterator[Fields]:
        """Yield incoming messages, except heartbeats, until CodeBotler closes its end or dies."""
        for line in iter(self._in.readline, ""):
            message = json.loads(line)
            if message.get("do") != "alive":
                self.last_alive = float("inf")
                yield message
            self.last_alive = time.monotonic()

    def _write(self) -> None:
        for line in iter(self._lines.get, None):
            with suppress(OSError, ValueError):
                self._out.write(line)
                self._out.flush()


def serve(make_worker: Callable[[Channel, Fields], Any]) -> None:
    """Create a worker from the first message, pass it all others, then stop the robot and exit."""
    channel = Channel()
    worker, status = None, 1
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda *_: sys.exit())
    try:
        lines = channel.lines()
        start = next(lines, None)
        if start is None:
            return
        try:
            worker = make_worker(channel, start)
        except SetupError as error:
            channel.send("not-ready", text=str(error))
            return
        except ImportError as error:
            channel.send("not-ready", text=f"{sys.executable} has no ROS: {error}; source ROS")
            return
        for line in lines:
            worker.obey(line)
        status = 0
    except Exception:  # noqa: BLE001 - the robot must stop after any error
        traceback.print_exc()
    finally:
        if worker is not None:
            worker.leave()
        channel.finish()
        sys.stderr.flush()
        os._exit(status)  # a normal exit would wait for rospy's threads
