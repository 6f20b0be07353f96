"""The worker for a robot behind a rosbridge, which runs under CodeBotler's own Python."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable

from channel import Fields, SetupError, serve
from goals import Goal, Server, SkillWorker
from message_types import split_type
from rosbridge_connection import (
    CONNECTION_FAULTS,
    INSIST_SECONDS,
    SETTLE_SECONDS,
    GoalUpdate,
    RosbridgeConnection,
)

RESEND_SECONDS = 0.5  # how long to wait before repeating a message that had no effect


class RosbridgeServer(Server):
    """A client, through a rosbridge, for the action server, service or topic of one skill."""

    def __init__(self, connection: RosbridgeConnection, action: Fields) -> None:
        super().__init__(action)
        self.kind: str = action["kind"]
        self._connection = connection
        self._since = time.monotonic()
        if self.kind == "topic":
            connection.send({"op": "advertise", "topic": self.name, "type": "/".join(split_type(self.type))})

    def last_alive(self) -> float:
        """Return the monotonic time of the server's last status, or the current time if it sends none."""
        if self._connection.protocol.has_status and self.kind == "action":
            return self._connection.heard.get(self.name, 0.0)
        return time.monotonic()

    def is_connected(self, _silence: float) -> bool:
        """Return whether goals and messages will reach the server, and its results will reach us."""
        if self._connection.is_lost:
            return False
        if self.kind == "topic":
            return time.monotonic() - self._since > SETTLE_SECONDS
        has_status = self._connection.protocol.has_status and self.kind == "action"
        return not has_status or self.name in self._connection.settled

    def cancel(self, goal: str = "") -> None:
        """Cancel one goal, or all goals if the id `goal` is empty. Services and topics ignore this."""
        if self.kind == "action":
            self._connection.send(self._connection.protocol.cancel(self.name, goal))


class RosbridgeWorker(SkillWorker):
    """Performs skills on a robot behind a rosbridge server, over a websocket."""

    graph: RosbridgeConnection
    settles = SETTLE_SECONDS

    def connect(self, start: Fields) -> bool:
        """Open the connection, and return False, because dead workers leave no node behind."""
        calls = start["calls"]
        actions = [call for call in calls.values() if call["kind"] == "action"]
        try:
            self.graph = RosbridgeConnection(start["address"], actions, self._hear, self._lost)
        except CONNECTION_FAULTS as error:
            mend = "start it, or name another with --address"
            raise SetupError(f"no rosbridge answers at {start['address']} ({error}); {mend}") from None
        self.servers = {skill: RosbridgeServer(self.graph, call) for skill, call in calls.items()}
        self._message: Fields = {}
        self._again = 0.0
        return False

    def listen(
        self, topic: str, hear: Callable[[Fields], object], *, is_needed: bool = True
    ) -> Callable[[], object]:
        """Subscribe to a topic, as `SkillWorker.listen` describes, even if nothing publishes it."""
        del is_needed
        return self.graph.listen(topic, hear)

    def missing(self) -> dict[str, str]:
        """Return no messages, because missing servers are noticed only when their skills are performed."""
        return {}

    def cancel_all(self) -> bool:
        """Cancel all goals repeatedly for 3 s. Return False if this is impossible, as on ROS 2."""
        if not self.graph.protocol.has_status:
            return False
        deadline = time.monotonic() + INSIST_SECONDS
        while time.monotonic() < deadline:
            super().cancel_all()
        return not self.graph.is_lost

    def send(self, goal: Goal, fields: Fields) -> None:
        """Send a goal, call a service, or publish a message, depending on the kind of server."""
        server, protocol = goal.server, self.graph.protocol
        number = goal.handle = str(uuid.uuid4())
        if server.kind == "action":
            self._message = protocol.goal(server.name, server.type, number, fields)
            goal.stop = lambda: server.cancel(number)
        elif server.kind == "service":
            about = {"id": number, "service": server.name, "type": "/".join(split_type(server.type))}
            self._message = {"op": "call_service", **about, "args": fields}
        else:
            self._message = {"op": "publish", "topic": server.name, "msg": fields}
        goal.is_acknowledged = server.kind != "action" or not protocol.has_status
        goal.sent = time.monotonic()
        self._again = goal.sent + RESEND_SECONDS
        self.graph.send(self._message)
        if server.kind == "topic":
            self.end(goal, "result", values={})

    def check_goal(self, goal: Goal, sent: float, now: float) -> None:
        """Check the goal, and send a goal or a cancel again if it had no effect."""
        if self.graph.is_lost:
            return
        super().check_goal(goal, sent, now)
        with goal.lock:
            if not self.graph.protocol.has_status or goal.is_over or now < self._again:
                return
            self._again = now + RESEND_SECONDS
            if goal.cancelled is not None:
                goal.cancel()
            elif not goal.is_acknowledged:
                self.graph.send(self._message)

    def _hear(self, update: GoalUpdate) -> None:
        goal = self.goal
        if goal is None or goal.is_over or goal.handle != update.goal:
            return
        goal.is_acknowledged = True
        if update.what == "feedback":
            self.pass_on(goal, update.values)
        elif update.what == "status":
            if update.state and goal.status_ended is None:
                goal.status_ended = time.monotonic()
        else:
            text = update.text
            if update.state == "lost":
                why = text or "no reason is given"
                text = f"rosbridge could not perform the goal of {goal.server.name}: {why}"
            self.finish(goal, update.state, update.values, text)

    def _lost(self) -> None:
        """After the connection is lost, cancel the current goal over a new connection."""
        goal = self.goal
        if goal is not None and goal.sent is not None and not goal.is_over:
            lost, protocol = f"the connection to {self.graph.address} was lost", self.graph.protocol
            cancel = protocol.cancel(goal.server.name, goal.handle)
            is_sent = goal.server.kind == "action" and self.graph.insist(cancel)
            # A rosbridge of ROS 2 that was restarted ignores cancels of the goals before.
            if is_sent and protocol.has_status:
                text = f"{lost}; the goal was cancelled over a new connection"
            else:
                text = f"{lost}, but the goal may continue: STOP THE ROBOT BY HAND"
            self.end(goal, "lost", text=text)


if __name__ == "__main__":
    serve(RosbridgeWorker)
