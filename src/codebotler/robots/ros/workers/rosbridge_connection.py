"""The websocket connection to a rosbridge."""

from __future__ import annotations

import json
import queue
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import connect

from channel import Fields
from rosbridge_protocol import ActionProtocol, GoalUpdate, Ros1Protocol, Ros2Protocol, service_updates

VERSION_REQUEST = {"op": "call_service", "id": "version", "service": "/rosapi/get_ros_version", "args": {}}
VERSION_SECONDS = 2.0  # how long to wait for the ROS version; a rosbridge without rosapi does not answer
SETTLE_SECONDS = 1.5  # the time from a server's first status until its results arrive, on a busy machine
INSIST_SECONDS, RESEND_PAUSE = 3.0, 0.1  # how long and how often to repeat a message nobody may hear yet
OPEN_SECONDS, SOCKET_CLOSE_SECONDS = 5.0, 1.0
CONNECTION_FAULTS = (OSError, ValueError, WebSocketException)


class RosbridgeConnection:
    """Sends messages, and runs a thread that passes goal updates to `hear` and calls `lost` when it ends."""

    def __init__(
        self,
        address: str,
        actions: Iterable[Any],
        hear: Callable[[GoalUpdate], None],
        lost: Callable[[], None],
    ) -> None:
        self.address, self._hear, self._lost = address, hear, lost
        self._socket = connect(
            address, open_timeout=OPEN_SECONDS, close_timeout=SOCKET_CLOSE_SECONDS, max_size=None
        )
        self._version: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._heard_first: dict[str, float] = {}
        self._listeners: dict[str, tuple[Callable[[Fields], object], ...]] = {}
        self.heard: dict[str, float] = {}  # when each server last sent its status
        self.settled: set[str] = set()  # the servers whose results will reach us
        self.is_lost = self.has_ended = False
        self.complaint = ""
        self.protocol: ActionProtocol = Ros1Protocol()
        threading.Thread(target=self._read, daemon=True).start()
        self.send(VERSION_REQUEST)
        with suppress(queue.Empty):  # without an answer, assume ROS 1
            if self._version.get(timeout=VERSION_SECONDS) == 2:  # noqa: PLR2004 - ROS 2
                self.protocol = Ros2Protocol()
        self.opening = [m for a in actions for m in self.protocol.opening(a["server"], a["type"])]
        for message in self.opening:
            self.send(message)

    def send(self, message: Fields) -> None:
        """Send a message. If the connection is lost, `is_lost` becomes true."""
        with suppress(ConnectionClosed):
            self._socket.send(json.dumps(message))

    def listen(self, topic: str, hear: Callable[[Fields], object]) -> Callable[[], None]:
        """Subscribe to a topic, and return a function that ends all subscriptions to this topic."""
        if topic not in self._listeners:
            self.send({"op": "subscribe", "topic": topic})
        self._listeners[topic] = (*self._listeners.get(topic, ()), hear)

        def unsubscribe() -> None:
            del self._listeners[topic]
            self.send({"op": "unsubscribe", "topic": topic})

        return unsubscribe

    def insist(self, message: Fields) -> bool:
        """Send a message repeatedly over a new connection, and return whether this was possible."""
        deadline, is_sent = time.monotonic() + INSIST_SECONDS, False
        while time.monotonic() < deadline:
            with (
                suppress(*CONNECTION_FAULTS),
                connect(self.address, open_timeout=OPEN_SECONDS, close_timeout=SOCKET_CLOSE_SECONDS) as other,
            ):
                for first in self.opening:
                    if first["op"] == "advertise":
                        other.send(json.dumps(first))
                while time.monotonic() < deadline:
                    other.send(json.dumps(message))
                    is_sent = True
                    time.sleep(RESEND_PAUSE)
            time.sleep(RESEND_PAUSE)
        return is_sent

    def leave(self) -> None:
        """Close the connection."""
        self._lost = lambda: None
        self._socket.close()

    def has_left(self) -> bool:
        """Return whether the connection is lost and `lost` has been called."""
        return self.has_ended

    def explain_end(self) -> str:
        """Return a message that says that the connection was lost."""
        return f"the connection to {self.address} was lost"

    def explain_missing(self, server: str, _type: str) -> str:
        """Return a message that explains why an action server cannot be reached."""
        if self.is_lost:
            return self.explain_end()
        why = f" ({self.complaint})" if self.complaint else ""
        return f"there is no action server at {server}, or none that rosbridge could reach{why}"

    def _read(self) -> None:
        with suppress(ConnectionClosed):
            for text in self._socket:
                try:
                    self._take(json.loads(text))
                except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
                    self.complaint = f"it sent something that is not a rosbridge message: {text[:100]!r}"
        self.is_lost = True
        self._lost()
        self.has_ended = True

    def _take(self, message: Fields) -> None:
        match message:
            case {"op": "service_response", "id": "version", "result": True, "values": {"version": int(ros)}}:
                self._version.put(ros)
            case {"op": "service_response", "id": "version"}:
                self._version.put(1)
            case {"op": "publish", "topic": str(topic), "msg": dict(fields)}:
                for hear in self._listeners.get(topic, ()):
                    hear(fields)
            case {"op": "status", "level": "error", "msg": str(complaint)}:
                self.complaint = complaint
        for update in (*self.protocol.updates(message), *service_updates(message)):
            if update.goal:
                self._hear(update)
            elif update.server:
                self.heard[update.server] = now = time.monotonic()
                if now - self._heard_first.setdefault(update.server, now) > SETTLE_SECONDS:
                    self.settled.add(update.server)
