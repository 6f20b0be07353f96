"""The websocket connection to a rosbridge, and its messages for goals.

ROS 1 actions use topics, and ROS 2 actions have their own operations.
"""

from __future__ import annotations

import json
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.sync.client import connect

from channel import Fields
from goals import ROS1_ENDS, ROS2_ENDS
from message_types import split_type

VERSION_REQUEST = {"op": "call_service", "id": "version", "service": "/rosapi/get_ros_version", "args": {}}
VERSION_SECONDS = 2.0  # how long to wait for the ROS version; a rosbridge without rosapi does not answer
SETTLE_SECONDS = 1.5  # the time from a server's first status until its results arrive, on a busy machine
INSIST_SECONDS, RESEND_PAUSE = 3.0, 0.1  # how long and how often to repeat a message nobody may hear yet
OPEN_SECONDS, SOCKET_CLOSE_SECONDS = 5.0, 1.0
CONNECTION_FAULTS = (OSError, ValueError, WebSocketException)
NO_STAMP = {"secs": 0, "nsecs": 0}
RECALLED = 7
"""The status of a goal that was cancelled before it started."""


@dataclass(frozen=True)
class GoalUpdate:
    """A goal's new status, feedback or end. With an empty `goal`, it only shows that the server is alive."""

    goal: str  # the goal id, or an empty string
    what: str  # status (which implies that the server has accepted the goal), feedback or ended
    state: str = ""  # the final state (succeeded, aborted, rejected, cancelled or lost) if it is known
    text: str = ""  # the server's explanation of the state
    values: Fields = field(default_factory=dict)  # the fields of the feedback or the result
    server: str = ""  # the server that sent a status


class Ros1Protocol:
    """The rosbridge messages for ROS 1 actions, whose goals, results and statuses are sent on topics."""

    has_status = True  # servers send their status regularly, so a silent server is dead

    def opening(self, server: str, action: str) -> Iterator[Fields]:
        """Yield the first messages, which advertise goals and cancels and subscribe to results."""
        kind = "/".join(split_type(action)) + "Action"
        for op, name, of in (
            ("advertise", "goal", f"{kind}Goal"),
            ("advertise", "cancel", "actionlib_msgs/GoalID"),
            ("subscribe", "result", f"{kind}Result"),
            ("subscribe", "feedback", f"{kind}Feedback"),
            ("subscribe", "status", "actionlib_msgs/GoalStatusArray"),  # it shows that the others are set up
        ):
            yield {"op": op, "topic": f"{server}/{name}", "type": of}

    def goal(self, server: str, _action: str, goal: str, fields: Fields) -> Fields:
        """Return the message for a goal with id `goal` and content `fields`. Repeated ids are ignored."""
        msg = {"goal_id": {"id": goal, "stamp": NO_STAMP}, "goal": fields}
        return {"op": "publish", "topic": f"{server}/goal", "msg": msg}

    def cancel(self, server: str, goal: str) -> Fields:
        """Return the message that cancels the goal with the id `goal`, or all goals if the id is empty."""
        return {"op": "publish", "topic": f"{server}/cancel", "msg": {"id": goal, "stamp": NO_STAMP}}

    def updates(self, message: Fields) -> Iterator[GoalUpdate]:
        """Yield the goal updates in a received message."""
        match message:
            case {"op": "publish", "topic": str(topic), "msg": {"status_list": list(statuses)}}:
                server = topic.rpartition("/")[0]
                yield GoalUpdate("", "status", server=server)
                for status in statuses:
                    goal, now = status["goal_id"]["id"], status["status"]
                    if now == RECALLED:
                        yield GoalUpdate(goal, "ended", "cancelled", server=server)
                    else:
                        yield GoalUpdate(goal, "status", ROS1_ENDS.get(now, ""), server=server)
            case {"op": "publish", "msg": {"status": status, "result": dict(values)}}:
                state = ROS1_ENDS.get(status["status"], "lost")
                yield GoalUpdate(status["goal_id"]["id"], "ended", state, status["text"], values)
            case {"op": "publish", "msg": {"status": status, "feedback": dict(values)}}:
                yield GoalUpdate(status["goal_id"]["id"], "feedback", values=values)


class Ros2Protocol:
    """The rosbridge messages for ROS 2 actions. They are tested only against a simulated rosbridge."""

    has_status = False

    def opening(self, _server: str, _action: str) -> Iterator[Fields]:
        """Yield nothing, because ROS 2 actions need no preparation."""
        yield from ()

    def goal(self, server: str, action: str, goal: str, fields: Fields) -> Fields:
        """Return the message that sends a goal with id `goal` and content `fields`, and requests feedback."""
        return {
            "op": "send_action_goal",
            "id": goal,
            "action": server,
            "action_type": "/action/".join(split_type(action)),
            "args": fields,
            "feedback": True,
        }

    def cancel(self, server: str, goal: str) -> Fields:
        """Return the message that cancels the goal with the id `goal`."""
        return {"op": "cancel_action_goal", "id": goal, "action": server}

    def updates(self, message: Fields) -> Iterator[GoalUpdate]:
        """Yield the goal updates in a received message."""
        match message:
            case {"op": "action_feedback", "id": str(goal), "values": dict(values)}:
                yield GoalUpdate(goal, "feedback", values=values)
            case {"op": "action_result", "id": str(goal), "status": int(status), "values": dict(values)}:
                yield GoalUpdate(goal, "ended", ROS2_ENDS.get(status, "lost"), values=values)
            case {"op": "action_result", "id": str(goal), "values": why}:  # rosbridge could not send the goal
                yield GoalUpdate(goal, "ended", "lost", text=str(why))


def service_updates(message: Fields) -> Iterator[GoalUpdate]:
    """Yield the end of a service call if a received message is its answer."""
    match message:
        case {"op": "service_response", "id": str(goal), "result": True, **more}:  # `values` is optional
            yield GoalUpdate(goal, "ended", "succeeded", values=more.get("values") or {})
        case {"op": "service_response", "id": str(goal), **more}:
            yield GoalUpdate(goal, "ended", "aborted", text=str(more.get("values", "")))


ActionProtocol: TypeAlias = Ros1Protocol | Ros2Protocol


class RosbridgeConnection:
    """A rosbridge connection. Its thread calls `hear` for each goal update and `lost` if the link breaks."""

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
        """Send a message repeatedly for 3 s over a new connection. Return whether it was sent at all."""
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
        """Close the connection without calling `lost`."""
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
                    self.complaint = f"a reply is not a rosbridge message: {text[:100]!r}"
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
