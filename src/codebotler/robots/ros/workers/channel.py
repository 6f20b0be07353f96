"""Exchange lines of JSON with CodeBotler, and run a worker's main loop."""

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
WRITE_SECONDS = 1.0  # for the last lines


class SetupError(Exception):
    """The robot cannot be used; the text says why, and how to fix it."""


class Channel:
    """Lines of JSON on standard input and output; other output of rospy goes to standard error."""

    def __init__(self) -> None:
        self._out = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)
        self._in: IO[str] = os.fdopen(os.dup(0), "r", encoding="utf-8")
        # Write in a thread, since a suspended tool does not read, and stopping the robot must not wait.
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._writer = threading.Thread(target=self._write, daemon=True)
        self._writer.start()
        self.last_sign = float("inf")  # the time of the last input; infinite while the worker handles it

    def send(self, kind: str, **more: Any) -> None:
        """Queue a message; a dead tool shows at the end of the input."""
        self._lines.put(json.dumps({"is": kind, **more}, default=str) + "\n")

    def finish(self) -> None:
        """Wait briefly until all lines are written."""
        self._lines.put(None)
        self._writer.join(WRITE_SECONDS)

    def lines(self) -> Iterator[Fields]:
        """Yield incoming messages except signs of life, until the tool closes its end or dies."""
        for line in iter(self._in.readline, ""):
            message = json.loads(line)
            if message.get("do") != "alive":
                self.last_sign = float("inf")
                yield message
            self.last_sign = time.monotonic()

    def _write(self) -> None:
        for line in iter(self._lines.get, None):
            with suppress(OSError, ValueError):
                self._out.write(line)
                self._out.flush()


def serve(make_worker: Callable[[Channel, Fields], Any]) -> None:
    """Make a worker from the first line, and let it obey the others; stop the robot in any case."""
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
            channel.send("not-ready", text=f"{sys.executable} has no ROS: {error}")
            return
        for line in lines:
            worker.obey(line)
        status = 0
    except Exception:  # noqa: BLE001 - after any error, the robot must stop
        traceback.print_exc()
    finally:
        if worker is not None:
            worker.leave()
        channel.finish()
        sys.stderr.flush()
        os._exit(status)  # rospy's threads would keep the process alive
