"""Lines of JSON between the worker and the tool."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from typing import IO, Any, Dict

Message = Dict[str, Any]


class NotReadyError(Exception):
    """The robot cannot be driven; the text says why and how to mend it."""


class Channel:
    """Lines of JSON in both directions; what rospy prints goes to standard error instead."""

    def __init__(self) -> None:
        self._out = os.fdopen(os.dup(1), "w", encoding="utf-8")
        os.dup2(2, 1)
        self._in: IO[str] = os.fdopen(os.dup(0), "r", encoding="utf-8")
        self._lock = threading.Lock()

    def tell(self, what: str, **more: Any) -> None:
        """Write one line; in vain where nobody reads any more."""
        with self._lock:
            try:
                self._out.write(json.dumps({"is": what, **more}, default=str) + "\n")
                self._out.flush()
            except (OSError, ValueError):
                return

    def lines(self) -> Iterator[Message]:
        """What is said on the other side, until it goes away."""
        for line in iter(self._in.readline, ""):
            yield json.loads(line)


def main(work: Callable[[Channel, Message], Any]) -> None:
    """Serve until the input ends.

    Args:
        work: makes of a channel and the first line what obeys the others.
    """
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
            worker = work(channel, start)
        except NotReadyError as error:
            channel.tell("not-ready", text=str(error))
            return
        except ImportError as error:
            channel.tell("not-ready", text=f"{sys.executable} has no ROS: {error}")
            return
        for line in lines:
            worker.obey(line)
        status = 0
    except Exception:  # noqa: BLE001 - whatever it is, the robot is to be stopped
        traceback.print_exc()
    finally:
        if worker is not None:
            worker.leave()
        sys.stderr.flush()
        os._exit(status)  # rospy's threads would go on
