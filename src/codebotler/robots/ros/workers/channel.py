"""Lines of JSON between a worker and the tool, and the worker's main loop."""

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

Message = Dict[str, Any]
WRITES = 1.0  # seconds for the tool to read the last lines


class SetupError(Exception):
    """The robot cannot be used; the text says why and what to do."""


class Channel:
    """Standard input and output as lines of JSON; whatever else rospy prints goes to standard error."""

    def __init__(self) -> None:
        self._out = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)
        self._in: IO[str] = os.fdopen(os.dup(0), "r", encoding="utf-8")
        # A tool that is suspended reads nothing: who stops the robot then must not wait for it.
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._writer = threading.Thread(target=self._write, daemon=True)
        self._writer.start()
        self.heard = float("inf")  # when the tool last sent something; infinite while a worker acts upon it

    def send(self, what: str, **more: Any) -> None:
        """Have a line written; a tool that is gone is noticed at the end of the input."""
        self._lines.put(json.dumps({"is": what, **more}, default=str) + "\n")

    def finish(self) -> None:
        """Wait a moment until all is written."""
        self._lines.put(None)
        self._writer.join(WRITES)

    def lines(self) -> Iterator[Message]:
        """Incoming messages but for signs of life, until the tool closes its end or dies."""
        for line in iter(self._in.readline, ""):
            message = json.loads(line)
            if message.get("do") != "alive":
                self.heard = float("inf")
                yield message
            self.heard = time.monotonic()

    def _write(self) -> None:
        for line in iter(self._lines.get, None):
            with suppress(OSError, ValueError):
                self._out.write(line)
                self._out.flush()


def serve(make_worker: Callable[[Channel, Message], Any]) -> None:
    """Make a worker from the first line and have it obey the others; however that ends, stop the robot."""
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
    except Exception:  # noqa: BLE001 - whatever it is, the robot must be stopped
        traceback.print_exc()
    finally:
        if worker is not None:
            worker.leave()
        channel.finish()
        sys.stderr.flush()
        os._exit(status)  # rospy's threads would go on
