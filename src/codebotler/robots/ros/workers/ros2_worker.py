"""The worker for ROS 2, run by a Python (3.8 or later) that has rclpy."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

from channel import Message, SetupError, serve
from goals import ENDS_ROS2, TICK, Goal, Server, SkillWorker
from message_types import as_data
from ros2_graph import Ros2Graph
from ros2_types import fill, message_types

KEEPOUT = ("nav_msgs/msg/OccupancyGrid", "nav2_msgs/msg/CostmapFilterInfo")
REJECTED = 1  # of action_msgs/srv/CancelGoal
DISCOVERS = 3  # times the patience, for the first server to be discovered
TELLS = 2.0  # seconds after which a search for servers is told
AGAIN = 1.0  # seconds after which a result is asked for again
ALL = [0] * 16  # in a request to cancel, the number of a goal that stands for all


class Ros2Goal:
    """What a goal has on ROS 2 beside what all goals have; only the executor's thread changes it."""

    def __init__(self) -> None:
        self.uuid = list(uuid.uuid4().bytes)  # chosen here, so that it can be cancelled before it is accepted
        self.is_cancelling = False
        self.asked = 0.0  # when its result was asked for


class Ros2Server(Server):
    """The action server of one skill, seen from a client."""

    def __init__(self, worker: Ros2Worker, action: Message, spec: Any) -> None:
        import rclpy.action
        from action_msgs.msg import GoalStatusArray
        from action_msgs.srv import CancelGoal
        from rclpy.qos import qos_profile_action_status_default
        from sensor_msgs.msg import CompressedImage

        super().__init__(action)
        graph = worker.graph
        self.spec, self.message = spec, spec.Goal
        self.client = rclpy.action.ActionClient(graph.ours, spec, self.name)
        self._graph, self._request = graph, CancelGoal.Request
        self._cancels = graph.ours.create_client(CancelGoal, f"{self.name}/_action/cancel_goal")
        graph.ours.create_subscription(
            CompressedImage, f"{self.name}/picture", lambda m: worker.see(self, as_data(m.data)), 10
        )
        graph.ours.create_subscription(
            GoalStatusArray,
            f"{self.name}/_action/status",
            lambda statuses: worker.hear(self, statuses),
            qos_profile_action_status_default,
        )
        self.has_cancelled = False

    def heard(self) -> float:
        """Now, by the monotonic clock, if it is there: DDS has already waited for one that is not."""
        return time.monotonic() if self.client.server_is_ready() else 0.0

    def is_connected(self, _silence: float) -> bool:
        """Whether it is there."""
        return bool(self.client.server_is_ready())

    def shows_pictures(self) -> bool:
        """Whether anything publishes what it sees."""
        return bool(self._graph.ours.count_publishers(f"{self.name}/picture"))

    def cancel(self) -> None:
        """Ask to cancel all goals of all clients; `has_cancelled` tells when the server has."""
        self._graph.soon(lambda: self.ask_to_cancel(ALL).add_done_callback(self._confirm))

    def _confirm(self, done: Any) -> None:
        if done.result() is not None and done.result().return_code != REJECTED:
            self.has_cancelled = True

    def ask_to_cancel(self, number: list[int]) -> Any:
        """Ask to cancel a goal, or ALL; the answer will be in what is returned. For the executor's thread."""
        request = self._request()
        request.goal_info.goal_id.uuid = number
        return self._cancels.call_async(request)


class Ros2Service(Server):
    """A service that performs a skill; what it does cannot be cancelled."""

    def __init__(self, worker: Ros2Worker, call: Message, spec: Any) -> None:
        super().__init__(call)
        self.message = spec.Request
        self.client = worker.graph.ours.create_client(spec, self.name)

    def is_connected(self, _silence: float) -> bool:
        """Whether it is there."""
        return bool(self.client.service_is_ready())

    def perform(self, message: Any, end: Callable[[Message], None]) -> None:
        """Call it, and end with its answer."""
        answer = self.client.call_async(message)
        answer.add_done_callback(lambda done: end(as_data(done.result())))


class Ros2Topic(Server):
    """A topic whose messages perform a skill, as far as anybody can know."""

    def __init__(self, worker: Ros2Worker, call: Message, spec: Any) -> None:
        super().__init__(call)
        self.message = spec
        self.publisher = worker.graph.ours.create_publisher(spec, self.name, 10)

    def is_connected(self, _silence: float) -> bool:
        """Whether anybody listens."""
        return bool(self.publisher.get_subscription_count())

    def perform(self, message: Any, end: Callable[[Message], None]) -> None:
        """Publish a message."""
        self.publisher.publish(message)
        end({})


KINDS = {"action": Ros2Server, "service": Ros2Service, "topic": Ros2Topic}


class Ros2Worker(SkillWorker):
    """Performs skills over ROS 2."""

    graph: Ros2Graph
    silence_says = "it has left the graph; DDS reports a killed process only after its lease, by default 20 s"

    def connect(self, start: Message) -> bool:
        """Start our node, and a client for each server; whether an earlier worker died without leaving."""
        from rclpy.qos import DurabilityPolicy, QoSProfile

        calls, self._packages = start["calls"], start["packages"]
        latched = dict(zip(start["keepout"], KEEPOUT))
        names = [*(call["type"] for call in calls.values()), *latched.values()]
        actions = {call["type"]: call["definition"] for call in calls.values() if call["definition"]}
        specs = message_types(names, map(Path, self._packages), self._tell, actions=actions)
        self.graph = Ros2Graph(start["node"])
        left_behind = self.graph.enter(is_rescue=start["cancel_all"])
        self.servers = {
            skill: KINDS[call["kind"]](self, call, specs[call["type"]]) for skill, call in calls.items()
        }
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._latched = {
            topic: self.graph.ours.create_publisher(specs[kind], topic, qos)
            for topic, kind in latched.items()
        }
        self.graph.spin()
        return left_behind

    def publish(self, topic: str, fields: Message) -> None:
        """Publish the last message of a topic, also for those who come later."""
        publisher = self._latched[topic]
        self.graph.soon(publisher.publish, fill(publisher.msg_type(), fields))

    def cancel_all(self) -> bool:
        """Cancel all goals of all clients; whether all servers that are there have confirmed it."""
        there = [server for server in self.servers.values() if server.is_connected(self.silence)]
        until = time.monotonic() + self.patience
        while there and time.monotonic() < until:
            for server in there:
                server.cancel()
            time.sleep(TICK)
            there = [server for server in there if not server.has_cancelled]
        return not there

    def wait_for_servers(self) -> None:
        """Wait while servers are discovered, one after the other."""
        begun = changed = time.monotonic()
        found, is_told = 0, False
        while found < len(self.servers) and not self.graph.is_left():
            now, before = time.monotonic(), found
            found = sum(server.is_connected(self.silence) for server in self.servers.values())
            changed = now if found != before else changed
            if now - changed > self.patience * (1 if found else DISCOVERS):
                break
            if now - begun > TELLS and not is_told:
                self.channel.send("progress", text="looking for the robot's action servers")
                is_told = True
            time.sleep(0.01)

    def send(self, goal: Goal, fields: Message) -> None:
        """Have the executor's thread send a goal, unless no message can hold it.

        Elsewhere, rclpy can lose the answer.
        """
        try:
            message = fill(goal.server.message(), fields)
            _check(message, fields)
        except (SetupError, ValueError) as error:
            self.end(goal, "unsent", text=f"the goal of {goal.server.name} cannot be sent: {error}")
            return
        goal.sent = time.monotonic()
        if not isinstance(goal.server, Ros2Server):
            goal.is_acknowledged = True
            self.graph.soon(
                goal.server.perform, message, lambda values: self.finish(goal, "succeeded", values)
            )
            return
        goal.handle = Ros2Goal()
        goal.stop = lambda: self.graph.soon(self._cancel, goal)
        self.graph.soon(self._send, goal, message)

    def listen(
        self, topic: str, hear: Callable[[Message], object], *, is_needed: bool = True
    ) -> Callable[[], object] | None:
        """Call `hear` with each message of a topic as plain data; what ends that, if the topic is there."""
        return self.graph.listen(topic, hear, self._packages, self.patience if is_needed else None)

    def _tell(self, text: str) -> None:
        self.channel.send("progress", text=text)

    def look_after(self, goal: Goal, sent: float, now: float) -> None:
        """Repeat what has no effect: a cancel may overtake its goal, and an answer may be lost."""
        super().look_after(goal, sent, now)
        if goal.is_over or goal.handle is None:  # services and topics cannot be cancelled
            return
        if goal.cancelled is not None and not goal.handle.is_cancelling and now - goal.cancelled > TICK:
            self.graph.soon(self._cancel, goal)
        if goal.status_ended is not None and now - max(goal.status_ended, goal.handle.asked) > AGAIN:
            self.graph.soon(self._ask_result, goal)

    def _send(self, goal: Goal, message: Any) -> None:
        from unique_identifier_msgs.msg import UUID

        if goal.cancelled is not None:
            self.end(goal, "cancelled")
            return
        goal.server.client.send_goal_async(
            message,
            feedback_callback=lambda m: self.pass_on(goal, as_data(m.feedback)),
            goal_uuid=UUID(uuid=goal.handle.uuid),
        ).add_done_callback(lambda done: self._accepted(goal, done.result()))

    def _accepted(self, goal: Goal, handle: Any) -> None:
        """Note whether the server accepts the goal."""
        if handle.accepted:
            self._accept(goal)
        else:
            self.end(goal, "cancelled" if goal.cancelled else "error", state="rejected", text="")

    def hear(self, server: Ros2Server, statuses: Any) -> None:
        """Note the status of the current goal, which the server publishes besides its answers."""
        goal = self.goal
        if goal is None or goal.is_over or goal.handle is None or goal.server is not server:
            return
        for status in statuses.status_list:
            if list(status.goal_info.goal_id.uuid) != goal.handle.uuid:
                continue
            self._accept(goal)
            if status.status in ENDS_ROS2 and goal.status_ended is None:
                goal.status_ended = time.monotonic()

    def _accept(self, goal: Goal) -> None:
        if not goal.is_acknowledged:
            goal.is_acknowledged = True
            self._ask_result(goal)

    def _ask_result(self, goal: Goal) -> None:
        from rclpy.action.client import ClientGoalHandle
        from unique_identifier_msgs.msg import UUID

        goal.handle.asked = time.monotonic()
        client = goal.server.client
        accepted = goal.server.spec.Impl.SendGoalService.Response(accepted=True)
        handle = ClientGoalHandle(client, UUID(uuid=goal.handle.uuid), accepted)
        client._get_result_async(handle).add_done_callback(lambda done: self._done(goal, done.result()))

    def _cancel(self, goal: Goal) -> None:
        answer = goal.server.ask_to_cancel(goal.handle.uuid)
        answer.add_done_callback(lambda done: self._cancelling(goal, done.result()))

    def _cancelling(self, goal: Goal, response: Any) -> None:
        if response is not None and response.goals_canceling:
            goal.handle.is_cancelling = True

    def _done(self, goal: Goal, response: Any) -> None:
        if goal.cancelled is None and response.status not in ENDS_ROS2:
            why = f"{goal.server.name} ended its goal with the status {response.status}"
            self.end(goal, "lost", text=why)
        else:
            self.finish(goal, ENDS_ROS2.get(response.status, "cancelled"), as_data(response.result))


def _check(message: Any, fields: Message) -> None:
    """Raise an error that says why a message cannot be sent; later, it would end the executor's thread."""
    from rclpy.serialization import serialize_message

    if r"\x00" in repr(fields).replace(r"\\", ""):  # strings of ROS 2 end there
        raise ValueError("a text contains NUL")
    serialize_message(message)


if __name__ == "__main__":
    serve(Ros2Worker)
