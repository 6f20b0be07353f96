"""Lines of JSON between a worker and the tool, and the worker's main loop."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from typing import IO, Any, Dict

Message = Dict[str, Any]


class SetupError(Exception):
    """The robot cannot be used; the text says why and what to do."""


class Channel:
    """Standard input and output as lines of JSON; whatever else rospy prints goes to standard error."""

    def __init__(self) -> None:
        self._out = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)
        self._in: IO[str] = os.fdopen(os.dup(0), "r", encoding="utf-8")
        self._lock = threading.Lock()
        self.heard = float("inf")  # when the tool last sent something; infinite while a worker acts upon it

    def send(self, what: str, **more: Any) -> None:
        """Write one line; a tool that is gone is noticed at the end of the input."""
        with self._lock:
            try:
                self._out.write(json.dumps({"is": what, **more}, default=str) + "\n")
                self._out.flush()
            except (OSError, ValueError):
                return

    def lines(self) -> Iterator[Message]:
        """Incoming messages but for signs of life, until the tool closes its end or dies."""
        for line in iter(self._in.readline, ""):
            message = json.loads(line)
            if message.get("do") != "alive":
                self.heard = float("inf")
                yield message
            self.heard = time.monotonic()


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
        sys.stderr.flush()
        os._exit(status)  # rospy's threads would go on
