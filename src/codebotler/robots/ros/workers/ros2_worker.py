"""The worker for ROS 2, which runs under a Python (3.8 or later) that has rclpy."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from channel import Fields, SetupError, serve
from goals import ROS2_ENDS, WATCH_SECONDS, Goal, Server, SkillWorker
from message_types import as_data
from ros2_graph import Ros2Graph
from ros2_types import fill, message_types

KEEPOUT_TYPES = ("nav_msgs/msg/OccupancyGrid", "nav2_msgs/msg/CostmapFilterInfo")
REJECTED = 1  # a return code of action_msgs/srv/CancelGoal
DISCOVERY_FACTOR = 3  # the time limit for finding the first server, as a multiple of the patience
PROGRESS_SECONDS = 2.0  # how long a search for servers may take before it is reported
RESULT_SECONDS = 1.0  # how long to wait for a result before requesting it again
ALL_GOALS = [0] * 16  # the goal id that means all goals in a cancel request


class Ros2Goal:
    """The ROS 2 state of a goal, which only the executor's thread may change."""

    def __init__(self) -> None:
        self.uuid = list(uuid.uuid4().bytes)  # chosen by us, so that a goal can be cancelled early
        self.is_cancelling = False
        self.result_request = 0.0  # when the result was last requested


class Ros2Server(Server):
    """A ROS 2 client for the action server of one skill."""

    def __init__(self, worker: Ros2Worker, action: Fields, spec: Any) -> None:
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
            CompressedImage, f"{self.name}/picture", lambda m: worker.pass_picture(self, as_data(m.data)), 10
        )
        graph.ours.create_subscription(
            GoalStatusArray,
            f"{self.name}/_action/status",
            lambda statuses: worker.update_status(self, statuses),
            qos_profile_action_status_default,
        )
        self.has_cancelled = False

    def last_alive(self) -> float:
        """Return the monotonic time if the server is on the graph, else 0. DDS drops dead servers late."""
        return time.monotonic() if self.client.server_is_ready() else 0.0

    def is_connected(self, _silence: float) -> bool:
        """Return whether the action server is on the ROS graph."""
        return bool(self.client.server_is_ready())

    def has_pictures(self) -> bool:
        """Return whether the server publishes pictures."""
        return bool(self._graph.ours.count_publishers(f"{self.name}/picture"))

    def cancel(self) -> None:
        """Request the cancellation of all goals of all clients. The server's answer sets `has_cancelled`."""
        self._graph.call_soon(lambda: self.request_cancel(ALL_GOALS).add_done_callback(self._confirm))

    def _confirm(self, done: Any) -> None:
        if done.result() is not None and done.result().return_code != REJECTED:
            self.has_cancelled = True

    def request_cancel(self, number: list[int]) -> Any:
        """Ask to cancel the goal with this id, or ALL_GOALS, from the executor's thread. Return a future."""
        request = self._request()
        request.goal_info.goal_id.uuid = number
        return self._cancels.call_async(request)


class Ros2Service(Server):
    """A client for a service that performs a skill. Calls cannot be cancelled."""

    def __init__(self, worker: Ros2Worker, call: Fields, spec: Any) -> None:
        super().__init__(call)
        self.message = spec.Request
        self.client = worker.graph.ours.create_client(spec, self.name)

    def is_connected(self, _silence: float) -> bool:
        """Return whether the service is on the graph."""
        return bool(self.client.service_is_ready())

    def perform(self, message: Any, end: Callable[[Fields], None]) -> None:
        """Call the service, and pass its answer to `end`."""
        answer = self.client.call_async(message)
        answer.add_done_callback(lambda done: end(as_data(done.result())))


class Ros2Topic(Server):
    """Publishes messages that make the robot perform a skill. The robot confirms nothing."""

    def __init__(self, worker: Ros2Worker, call: Fields, spec: Any) -> None:
        super().__init__(call)
        self.message = spec
        self.publisher = worker.graph.ours.create_publisher(spec, self.name, 10)

    def is_connected(self, _silence: float) -> bool:
        """Return whether the topic has subscribers."""
        return bool(self.publisher.get_subscription_count())

    def perform(self, message: Any, end: Callable[[Fields], None]) -> None:
        """Publish a message, and pass an empty answer to `end`."""
        self.publisher.publish(message)
        end({})


ROS2_SERVERS = {"action": Ros2Server, "service": Ros2Service, "topic": Ros2Topic}


class Ros2Worker(SkillWorker):
    """Performs skills on a ROS 2 robot through actions, services and topics."""

    graph: Ros2Graph
    silence_says = "the server has left the graph; DDS reports a killed process late, by default after 20 s"

    def connect(self, start: Fields) -> bool:
        """Start our node and a client for each server. Return whether a dead worker left its node behind."""
        from rclpy.qos import DurabilityPolicy, QoSProfile

        calls, self._packages = start["calls"], start["packages"]
        latched = dict(zip(start["keepout"], KEEPOUT_TYPES))
        names = [*(call["type"] for call in calls.values()), *latched.values()]
        actions = {call["type"]: call["definition"] for call in calls.values() if call["definition"]}
        specs = message_types(names, map(Path, self._packages), self._report, actions=actions)
        self.graph = Ros2Graph(start["node"])
        has_dead_twin = self.graph.enter(is_rescue=start["cancel_all"])
        self.servers = {
            skill: ROS2_SERVERS[call["kind"]](self, call, specs[call["type"]])
            for skill, call in calls.items()
        }
        qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._latched = {
            topic: self.graph.ours.create_publisher(specs[kind], topic, qos)
            for topic, kind in latched.items()
        }
        self.graph.spin()
        return has_dead_twin

    def publish(self, topic: str, fields: Fields) -> None:
        """Publish a latched message on one of the keepout topics."""
        publisher = self._latched[topic]
        self.graph.call_soon(publisher.publish, fill(publisher.msg_type(), fields))

    def cancel_all(self) -> bool:
        """Cancel all goals of all clients and return whether every server on the graph has confirmed this."""
        waiting = [server for server in self.servers.values() if server.is_connected(self.silence)]
        deadline = time.monotonic() + self.patience
        while waiting and time.monotonic() < deadline:
            for server in waiting:
                server.cancel()
            time.sleep(WATCH_SECONDS)
            waiting = [server for server in waiting if not server.has_cancelled]
        return not waiting

    def wait_for_servers(self) -> None:
        """Wait until all servers are on the graph, or no new one has appeared for a while."""
        start = change = time.monotonic()
        found, has_reported = 0, False
        while found < len(self.servers) and not self.graph.has_left():
            now, before = time.monotonic(), found
            found = sum(server.is_connected(self.silence) for server in self.servers.values())
            change = now if found != before else change
            if now - change > self.patience * (1 if found else DISCOVERY_FACTOR):
                break
            if now - start > PROGRESS_SECONDS and not has_reported:
                self._report("looking for the robot's action servers")
                has_reported = True
            time.sleep(0.01)

    def send(self, goal: Goal, fields: Fields) -> None:
        """Send a goal in the executor's thread, because rclpy can lose answers to other threads."""
        try:
            message = fill(goal.server.message(), fields)
            _check_sendable(message, fields)
        except (SetupError, ValueError) as error:
            self.end(goal, "unsent", text=f"the goal of {goal.server.name} cannot be sent: {error}")
            return
        goal.sent = time.monotonic()
        if not isinstance(goal.server, Ros2Server):
            goal.is_acknowledged = True
            end = partial(self.finish, goal, "succeeded")
            self.graph.call_soon(goal.server.perform, message, end)
            return
        goal.handle = Ros2Goal()
        goal.stop = lambda: self.graph.call_soon(self._cancel, goal)
        self.graph.call_soon(self._send, goal, message)

    def listen(
        self, topic: str, hear: Callable[[Fields], object], *, is_needed: bool = True
    ) -> Callable[[], object] | None:
        """Subscribe to a topic, as `SkillWorker.listen` describes."""
        return self.graph.listen(topic, hear, self._packages, self.patience if is_needed else None)

    def _report(self, text: str) -> None:
        self.channel.send("progress", text=text)

    def check_goal(self, goal: Goal, sent: float, now: float) -> None:
        """Check a goal's time limits. Repeat a cancel or a request for the result if it had no effect."""
        super().check_goal(goal, sent, now)
        handle, cancelled, ended = goal.handle, goal.cancelled, goal.status_ended
        if goal.is_over or handle is None:  # calls of services and topics have no handle
            return
        if cancelled is not None and not handle.is_cancelling and now - cancelled > WATCH_SECONDS:
            self.graph.call_soon(self._cancel, goal)
        if ended is not None and now - max(ended, handle.result_request) > RESULT_SECONDS:
            self.graph.call_soon(self._request_result, goal)

    def _send(self, goal: Goal, message: Any) -> None:
        from unique_identifier_msgs.msg import UUID

        if goal.cancelled is not None:
            self.end(goal, "cancelled")
            return
        goal.server.client.send_goal_async(
            message,
            feedback_callback=lambda m: self.pass_on(goal, as_data(m.feedback)),
            goal_uuid=UUID(uuid=goal.handle.uuid),
        ).add_done_callback(lambda done: self._handle_response(goal, done.result()))

    def _handle_response(self, goal: Goal, handle: Any) -> None:
        """Handle the server's answer, which accepts or rejects the goal."""
        if handle.accepted:
            self._accept(goal)
        else:
            self.end(goal, "cancelled" if goal.cancelled else "error", state="rejected", text="")

    def update_status(self, server: Ros2Server, statuses: Any) -> None:
        """Record what a server's statuses say about the current goal: that it was accepted or has ended."""
        goal = self.goal
        if goal is None or goal.is_over or goal.handle is None or goal.server is not server:
            return
        for status in statuses.status_list:
            if list(status.goal_info.goal_id.uuid) != goal.handle.uuid:
                continue
            self._accept(goal)
            if status.status in ROS2_ENDS and goal.status_ended is None:
                goal.status_ended = time.monotonic()

    def _accept(self, goal: Goal) -> None:
        if not goal.is_acknowledged:
            goal.is_acknowledged = True
            self._request_result(goal)

    def _request_result(self, goal: Goal) -> None:
        from rclpy.action.client import ClientGoalHandle
        from unique_identifier_msgs.msg import UUID

        goal.handle.result_request = time.monotonic()
        client = goal.server.client
        accepted = goal.server.spec.Impl.SendGoalService.Response(accepted=True)
        handle = ClientGoalHandle(client, UUID(uuid=goal.handle.uuid), accepted)
        answer = client._get_result_async(handle)
        answer.add_done_callback(lambda done: self._finish_goal(goal, done.result()))

    def _cancel(self, goal: Goal) -> None:
        answer = goal.server.request_cancel(goal.handle.uuid)
        answer.add_done_callback(lambda done: self._record_cancel(goal, done.result()))

    def _record_cancel(self, goal: Goal, response: Any) -> None:
        if response is not None and response.goals_canceling:
            goal.handle.is_cancelling = True

    def _finish_goal(self, goal: Goal, response: Any) -> None:
        if goal.cancelled is None and response.status not in ROS2_ENDS:
            why = f"{goal.server.name} ended its goal with the unexpected status {response.status}"
            self.end(goal, "lost", text=why)
        else:
            self.finish(goal, ROS2_ENDS.get(response.status, "cancelled"), as_data(response.result))


def _check_sendable(message: Any, fields: Fields) -> None:
    """Raise an error if a message cannot be sent, before it can crash the executor's thread."""
    from rclpy.serialization import serialize_message

    if r"\x00" in repr(fields).replace(r"\\", ""):  # ROS 2 truncates strings at NUL
        raise ValueError("a string contains the character NUL; remove it")
    serialize_message(message)


if __name__ == "__main__":
    serve(Ros2Worker)
