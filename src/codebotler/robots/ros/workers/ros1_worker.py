"""The worker for ROS 1, which runs under a Python (3.8 or later) that has rospy."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Callable
from typing import Any

from channel import Fields, SetupError, serve
from goals import ROS1_ENDS, Goal, Server, SkillWorker
from graph import Ros1Graph
from message_types import action_types, as_data, generate_type, import_type

RESULT_DELAY = 0.2  # the assumed seconds until results reach a new client, since ROS does not report this


class Ros1Server(Server):
    """A ROS 1 client for the action server of one skill."""

    def __init__(self, worker: Ros1Worker, action: Fields) -> None:
        import actionlib
        import actionlib_msgs.msg
        import rospy

        super().__init__(action)
        spec = action_types([action])[self.type]
        self.client = actionlib.ActionClient(self.name, spec)
        self.message = type(spec().action_goal.goal)
        self._last_status = 0.0
        self._node: str | None = None
        self._results: Any = None  # the connection that receives results
        self._since = 0.0
        topic = rospy.remap_name(self.name)
        self._status = rospy.Subscriber(f"{topic}/status", actionlib_msgs.msg.GoalStatusArray, self._hear)
        self._pictures = subscribe(
            f"{topic}/picture", lambda message: worker.pass_picture(self, message["data"])
        )

    def last_alive(self) -> float:
        """Return the monotonic time of the server's last status message, or 0 before the first."""
        return self._last_status

    def has_pictures(self) -> bool:
        """Return whether the server publishes pictures."""
        return bool(self._pictures.get_num_connections())

    def is_connected(self, silence: float) -> bool:
        """Return whether goals and results get through, and the last status is at most `silence` s old."""
        client, node = self.client, self._node
        if node is None or time.monotonic() - self._last_status > silence:
            return False
        results, feedback = (
            next((c for c in subscriber.impl.connections if c.callerid_pub == node), None)
            for subscriber in (client.result_sub, client.feedback_sub)
        )
        if results is not self._results:
            self._results, self._since = results, time.monotonic()
        if results is None or feedback is None or time.monotonic() - self._since <= RESULT_DELAY:
            return False
        return all(p.impl.has_connection(node) for p in (client.pub_goal, client.pub_cancel))

    def cancel(self, goal_id: str = "") -> None:
        """Cancel one goal, or all goals of all clients if `goal_id` is empty.

        This replaces actionlib's own `cancel`, which reports a goal that has not reached the server as lost.
        """
        import actionlib_msgs.msg

        self.client.pub_cancel.publish(actionlib_msgs.msg.GoalID(id=goal_id))

    def _hear(self, status: Any) -> None:
        self._last_status = time.monotonic()
        self._node = status._connection_header["callerid"]


class Ros1Service(Server):
    """A client for a service that performs a skill. Calls cannot be cancelled."""

    def __init__(self, worker: Ros1Worker, call: Fields) -> None:
        import rospy

        super().__init__(call)
        self.graph = worker.graph
        spec = import_type(self.type, "srv")
        self.message = spec._request_class
        self.client = rospy.ServiceProxy(self.name, spec)

    def is_connected(self, _silence: float) -> bool:
        """Return whether the service is registered with the master."""
        return bool(self.graph.nodes_of(self.name))

    def perform(self, message: Any) -> Fields:
        """Call the service and return its answer."""
        answer: Fields = as_data(self.client(message))
        return answer


class Ros1Topic(Server):
    """Publishes messages that make the robot perform a skill. The robot confirms nothing."""

    def __init__(self, _worker: Ros1Worker, call: Fields) -> None:
        import rospy

        super().__init__(call)
        self.message = import_type(self.type, "msg")
        self.publisher = rospy.Publisher(self.name, self.message, queue_size=10)

    def is_connected(self, _silence: float) -> bool:
        """Return whether the topic has subscribers."""
        return bool(self.publisher.get_num_connections())

    def perform(self, message: Any) -> Fields:
        """Publish a message and return an empty answer."""
        self.publisher.publish(message)
        return {}


def subscribe(topic: str, hear: Callable[[Fields], object]) -> Any:
    """Pass the messages of a topic, of any type, to `hear` as plain data. Return the rospy subscriber."""
    import rospy

    known: dict[str, Any] = {}

    def take(message: Any) -> None:
        header = message._connection_header
        kind = header["type"]
        if kind not in known:
            known[kind] = generate_type(kind, header["message_definition"])
        hear(as_data(known[kind]().deserialize(message._buff)))

    return rospy.Subscriber(topic, rospy.AnyMsg, take, queue_size=10)


ROS1_SERVERS = {"action": Ros1Server, "service": Ros1Service, "topic": Ros1Topic}


class Ros1Worker(SkillWorker):
    """Performs skills on a ROS 1 robot through actions, services and topics."""

    graph: Ros1Graph

    def connect(self, start: Fields) -> bool:
        """Register our node and connect to all servers. Return whether a dead worker left its node behind."""
        import rospy

        self.graph = Ros1Graph(start["node"])
        has_dead_twin = self.graph.enter()
        rospy.on_shutdown(self.stop)
        calls = start["calls"].items()
        self.servers = {skill: ROS1_SERVERS[call["kind"]](self, call) for skill, call in calls}
        return has_dead_twin

    def listen(
        self, topic: str, hear: Callable[[Fields], object], *, is_needed: bool = True
    ) -> Callable[[], object]:
        """Subscribe to a topic, as `SkillWorker.listen` describes."""
        if is_needed and not self.graph.has_publisher(topic):
            raise SetupError(f"nothing publishes {topic}; start its publisher, or correct the topic")
        unsubscribe: Callable[[], object] = subscribe(topic, hear).unregister
        return unsubscribe

    def send(self, goal: Goal, fields: Fields) -> None:
        """Send a goal, or end it as unsent if its fields do not fit its type."""
        import genpy

        try:  # serialize here first, because an error in rospy would leave half a message in the stream
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
            lambda handle: self._follow(goal, handle),
            lambda _, feedback: self.pass_on(goal, as_data(feedback)),
        )
        goal_id = goal.handle.comm_state_machine.action_goal.goal_id.id
        goal.stop = lambda: goal.server.cancel(goal_id)

    def _follow(self, goal: Goal, handle: Any) -> None:
        """Process a change in the state of a goal, in rospy's own thread."""
        from actionlib import CommState, TerminalState

        state = handle.get_comm_state()
        goal.is_acknowledged = True
        if state == CommState.WAITING_FOR_RESULT and goal.status_ended is None:
            goal.status_ended = time.monotonic()
        if state != CommState.DONE:
            return
        terminal, text = handle.get_terminal_state(), handle.get_goal_status_text()
        if terminal == TerminalState.LOST:
            text = f"{goal.server.name} no longer knows its goal; was the server restarted?"
        self.finish(goal, ROS1_ENDS[terminal], as_data(handle.get_result()), text)

    def _perform(self, goal: Goal, message: Any) -> None:
        """Perform a skill through a service or a topic."""
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
