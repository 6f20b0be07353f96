"""The worker for ROS 1, run by a Python (3.8 or later) that has rospy."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Callable
from typing import Any

from channel import Message, SetupError, serve
from goals import ENDS_ROS1, Goal, Server, SkillWorker
from graph import Ros1Graph
from message_types import as_data, installed, made, message_types

SETTLES = 0.2  # seconds until a server sends results to a new client: ROS tells neither side


class Ros1Server(Server):
    """The action server of one skill, seen from a client."""

    def __init__(self, worker: Ros1Worker, action: Message) -> None:
        import actionlib
        import actionlib_msgs.msg
        import rospy

        super().__init__(action)
        spec = message_types([action])[self.type]
        self.client = actionlib.ActionClient(self.name, spec)
        self.message = type(spec().action_goal.goal)
        self._heard = 0.0
        self._node: str | None = None
        self._results: Any = None  # the connection that brings them
        self._since = 0.0
        topic = rospy.remap_name(self.name)
        self._status = rospy.Subscriber(f"{topic}/status", actionlib_msgs.msg.GoalStatusArray, self._hear)
        self._pictures = subscribed(f"{topic}/picture", lambda message: worker.see(self, message["data"]))

    def heard(self) -> float:
        """When its last status came, by the monotonic clock."""
        return self._heard

    def shows_pictures(self) -> bool:
        """Whether anything publishes what it sees."""
        return bool(self._pictures.get_num_connections())

    def is_connected(self, silence: float) -> bool:
        """Whether goals reach it and its results reach us."""
        client, node = self.client, self._node
        if node is None or time.monotonic() - self._heard > silence:
            return False
        results, feedback = (
            next((c for c in subscriber.impl.connections if c.callerid_pub == node), None)
            for subscriber in (client.result_sub, client.feedback_sub)
        )
        if results is not self._results:
            self._results, self._since = results, time.monotonic()
        reached = all(p.impl.has_connection(node) for p in (client.pub_goal, client.pub_cancel))
        return reached and None not in (results, feedback) and time.monotonic() - self._since > SETTLES

    def cancel(self, goal_id: str = "") -> None:
        """Cancel one goal, or all goals of all clients.

        A handle's own `cancel` takes a goal for lost that the server has not heard of yet.
        """
        import actionlib_msgs.msg

        self.client.pub_cancel.publish(actionlib_msgs.msg.GoalID(id=goal_id))

    def _hear(self, status: Any) -> None:
        self._heard = time.monotonic()
        self._node = status._connection_header["callerid"]


class Ros1Service(Server):
    """A service that performs a skill; what it does cannot be cancelled."""

    def __init__(self, worker: Ros1Worker, call: Message) -> None:
        import rospy

        super().__init__(call)
        self.graph = worker.graph
        spec = installed(self.type, "srv")
        self.message = spec._request_class
        self.client = rospy.ServiceProxy(self.name, spec)

    def is_connected(self, _silence: float) -> bool:
        """Whether it is there."""
        return bool(self.graph.nodes_of(self.name))

    def perform(self, message: Any) -> Message:
        """Call it, and return its answer."""
        answer: Message = as_data(self.client(message))
        return answer


class Ros1Topic(Server):
    """A topic whose messages perform a skill, as far as anybody can know."""

    def __init__(self, _worker: Ros1Worker, call: Message) -> None:
        import rospy

        super().__init__(call)
        self.message = installed(self.type, "msg")
        self.publisher = rospy.Publisher(self.name, self.message, queue_size=10)

    def is_connected(self, _silence: float) -> bool:
        """Whether anybody listens."""
        return bool(self.publisher.get_num_connections())

    def perform(self, message: Any) -> Message:
        """Publish a message."""
        self.publisher.publish(message)
        return {}


def subscribed(topic: str, hear: Callable[[Message], object]) -> Any:
    """A subscriber that calls `hear` with each message as plain data, of the type that its publisher has."""
    import rospy

    known: dict[str, Any] = {}

    def take(message: Any) -> None:
        header = message._connection_header
        kind = header["type"]
        if kind not in known:
            known[kind] = made(kind, header["message_definition"])
        hear(as_data(known[kind]().deserialize(message._buff)))

    return rospy.Subscriber(topic, rospy.AnyMsg, take, queue_size=10)


KINDS = {"action": Ros1Server, "service": Ros1Service, "topic": Ros1Topic}


class Ros1Worker(SkillWorker):
    """Performs skills over ROS 1."""

    graph: Ros1Graph

    def connect(self, start: Message) -> bool:
        """Register our node, and subscribe to all servers."""
        import rospy

        self.graph = Ros1Graph(start["node"])
        left_behind = self.graph.enter()
        rospy.on_shutdown(self.stop)
        self.servers = {skill: KINDS[call["kind"]](self, call) for skill, call in start["calls"].items()}
        return left_behind

    def listen(
        self, topic: str, hear: Callable[[Message], object], *, is_needed: bool = True
    ) -> Callable[[], object]:
        """Call `hear` with each message of a topic as plain data; what ends that."""
        if is_needed and not self.graph.has_publisher(topic):
            raise SetupError(f"nothing publishes {topic}; start what does, or correct its name")
        end: Callable[[], object] = subscribed(topic, hear).unregister
        return end

    def send(self, goal: Goal, fields: Message) -> None:
        """Send a goal, unless no message can hold it."""
        import genpy

        try:  # an error within rospy would leave half a message on the line and spoil the next one
            message = goal.server.message()
            genpy.message.fill_message_args(message, [fields])
            message.serialize(io.BytesIO())
        except (genpy.SerializationError, genpy.MessageException, TypeError, ValueError) as error:
            self.end(goal, "unsent", text=f"the goal of {goal.server.name} cannot be sent: {error}")
            return
        goal.sent = time.monotonic()
        if not isinstance(goal.server, Ros1Server):
            goal.is_acknowledged = True
            threading.Thread(target=self._perform, args=(goal, message), daemon=True).start()
            return
        goal.handle = goal.server.client.send_goal(
            message,
            lambda handle: self._changed(goal, handle),
            lambda _, feedback: self.pass_on(goal, as_data(feedback)),
        )
        goal_id = goal.handle.comm_state_machine.action_goal.goal_id.id
        goal.stop = lambda: goal.server.cancel(goal_id)

    def _changed(self, goal: Goal, handle: Any) -> None:
        """Follow the state of a goal, in one of rospy's threads."""
        from actionlib import CommState, TerminalState

        state = handle.get_comm_state()
        goal.is_acknowledged = True
        if state == CommState.WAITING_FOR_RESULT and goal.status_ended is None:
            goal.status_ended = time.monotonic()
        if state != CommState.DONE:
            return
        terminal, text = handle.get_terminal_state(), handle.get_goal_status_text()
        if terminal == TerminalState.LOST:
            text = f"{goal.server.name} no longer knows its goal; was it restarted?"
        self.finish(goal, ENDS_ROS1[terminal], as_data(handle.get_result()), text)

    def _perform(self, goal: Goal, message: Any) -> None:
        """Perform what cannot be cancelled."""
        import rospy

        try:
            self.finish(goal, "succeeded", goal.server.perform(message))
        except rospy.ServiceException as error:
            if "responded with an error" in str(error):
                self.finish(goal, "aborted", {}, str(error))
            else:
                self.end(goal, "lost", text=f"the service {goal.server.name} has died: {error}")


if __name__ == "__main__":
    serve(Ros1Worker)
