"""A websocket with a rosbridge, through which a worker sees the ROS graph."""

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

from channel import Message
from rosbridge_protocol import ActionProtocol, GoalUpdate, Ros1Protocol, Ros2Protocol, service_updates

ASKS_VERSION = {"op": "call_service", "id": "version", "service": "/rosapi/get_ros_version", "args": {}}
VERSION = 2.0  # seconds that a rosbridge may take to tell its version of ROS; one without rosapi cannot
SETTLES = 1.5  # seconds of statuses from a server after which its results come too, on a busy machine
INSISTS, PAUSE = 3.0, 0.1  # seconds; what is sent first may come before the server listens
OPENS, CLOSES = 5.0, 1.0  # seconds that a rosbridge may take for that
FAULTS = (OSError, ValueError, WebSocketException)


class RosbridgeConnection:
    """Sends messages, and calls `hear` with news of goals, and `lost` once, in a thread of its own."""

    def __init__(
        self,
        address: str,
        actions: Iterable[Any],
        hear: Callable[[GoalUpdate], None],
        lost: Callable[[], None],
    ) -> None:
        self.address, self._hear, self._lost = address, hear, lost
        self._socket = connect(address, open_timeout=OPENS, close_timeout=CLOSES, max_size=None)
        self._version: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._heard_first: dict[str, float] = {}
        self._listeners: dict[str, tuple[Callable[[Message], object], ...]] = {}
        self.heard: dict[str, float] = {}  # when the last status of a server came, by the monotonic clock
        self.settled: set[str] = set()  # servers heard for so long that their results are connected too
        self.is_lost = self.has_ended = False
        self.complaint = ""
        self.protocol: ActionProtocol = Ros1Protocol()
        threading.Thread(target=self._read, daemon=True).start()
        self.send(ASKS_VERSION)
        with suppress(queue.Empty):  # it has no rosapi
            if self._version.get(timeout=VERSION) == 2:  # noqa: PLR2004 - ROS 2
                self.protocol = Ros2Protocol()
        self.opening = [m for a in actions for m in self.protocol.opening(a["server"], a["type"])]
        for message in self.opening:
            self.send(message)

    def send(self, message: Message) -> None:
        """Send a message; a lost connection shows in `is_lost`."""
        with suppress(ConnectionClosed):
            self._socket.send(json.dumps(message))

    def listen(self, topic: str, hear: Callable[[Message], object]) -> Callable[[], None]:
        """Call `hear` with each message of a topic; what ends that for all who listen to it."""
        if topic not in self._listeners:
            self.send({"op": "subscribe", "topic": topic})
        self._listeners[topic] = (*self._listeners.get(topic, ()), hear)

        def ignore() -> None:
            del self._listeners[topic]
            self.send({"op": "unsubscribe", "topic": topic})

        return ignore

    def insist(self, message: Message) -> bool:
        """Send a message over another connection, again and again for a while; whether that was possible."""
        until, is_sent = time.monotonic() + INSISTS, False
        while time.monotonic() < until:
            with suppress(*FAULTS), connect(self.address, open_timeout=OPENS, close_timeout=CLOSES) as other:
                for first in self.opening:
                    if first["op"] == "advertise":
                        other.send(json.dumps(first))
                while time.monotonic() < until:
                    other.send(json.dumps(message))
                    is_sent = True
                    time.sleep(PAUSE)
            time.sleep(PAUSE)
        return is_sent

    def leave(self) -> None:
        """Disconnect."""
        self._lost = lambda: None
        self._socket.close()

    def is_left(self) -> bool:
        """Whether the connection was lost, and all is done that could be done about it."""
        return self.has_ended

    def why_left(self) -> str:
        """Error message for a lost connection."""
        return f"the connection with {self.address} was lost"

    def why_missing(self, server: str, _type: str) -> str:
        """Why there is no connection with an action server."""
        if self.is_lost:
            return self.why_left()
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

    def _take(self, message: Message) -> None:
        match message:
            case {"op": "service_response", "id": "version", "result": True, "values": {"version": int(ros)}}:
                self._version.put(ros)
            case {"op": "service_response", "id": "version"}:
                self._version.put(1)
            case {"op": "publish", "topic": str(topic), "msg": dict(told)}:
                for hear in self._listeners.get(topic, ()):
                    hear(told)
            case {"op": "status", "level": "error", "msg": str(complaint)}:
                self.complaint = complaint
        for update in (*self.protocol.updates(message), *service_updates(message)):
            if update.goal:
                self._hear(update)
            elif update.server:
                self.heard[update.server] = now = time.monotonic()
                if now - self._heard_first.setdefault(update.server, now) > SETTLES:
                    self.settled.add(update.server)
