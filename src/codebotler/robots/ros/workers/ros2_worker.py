"""The worker for ROS 2, run by a Python (3.8 or later) that has rclpy.

It was tested against a stand-in for rclpy only, never on a ROS 2 graph.
"""

from __future__ import annotations

import importlib
import os
import threading
import time
from typing import Any

from channel import Message, SetupError, serve
from goals import Goal, SkillWorker
from message_types import parts_of

DISCOVERY = 1.0  # seconds after which a node knows most others
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6  # of action_msgs/msg/GoalStatus


class Ros2Graph:
    """The ROS 2 graph, which has no master; whoever has our node's name drives the robot."""

    def __init__(self, name: str) -> None:
        import rclpy
        import rclpy.executors

        self._rclpy, self.node = rclpy, name
        rclpy.init(args=None, **_without_signals())
        probe = rclpy.create_node(f"{name}_looks_{os.getpid()}")
        time.sleep(DISCOVERY)
        is_taken = name in probe.get_node_names()
        probe.destroy_node()
        if is_taken:
            rclpy.shutdown()
            raise SetupError(f"another codebotler is using this robot (the node {name}); stop it first")
        self.ours = rclpy.create_node(name)
        executor = rclpy.executors.SingleThreadedExecutor()
        executor.add_node(self.ours)
        threading.Thread(target=executor.spin, daemon=True).start()

    def leave(self) -> None:
        """Shut our node down."""
        self._rclpy.shutdown()

    def is_left(self) -> bool:
        """Whether our node was shut down."""
        return not self._rclpy.ok()

    def why_left(self) -> str:
        """Error message for a node that was shut down."""
        return f"the node {self.node} was shut down; connect again"

    def nodes_of(self, _server: str) -> list[str]:
        """A stand-in for any node, since one may still be discovered."""
        return ["a node to be discovered"]

    def why_missing(self, server: str, type_name: str) -> str:
        """Why there is no connection with an action server."""
        kind = "/action/".join(parts_of(type_name))
        return (
            f"there is no action server of {kind} at {server}; start it, or compare "
            "ROS_DOMAIN_ID and the definitions on both sides"
        )


def _without_signals() -> dict[str, Any]:
    """Options that keep a recent rclpy from ending at a signal before the robot has stopped."""
    try:
        from rclpy.signals import SignalHandlerOptions
    except ImportError:
        return {}
    return {"signal_handler_options": SignalHandlerOptions.NO}


class Ros2Server:
    """The action server of one skill, seen from a client."""

    def __init__(self, node: Any, action: Message) -> None:
        import rclpy.action
        from action_msgs.srv import CancelGoal

        self.name: str = action["server"]
        self.type: str = action["type"]
        goal, result, _ = action["definition"].split("---\n")
        self.fields = [line.split()[1] for line in goal.splitlines()]
        self.returns = [line.split()[1] for line in result.splitlines()]
        package, name = parts_of(self.type)
        self.spec = getattr(importlib.import_module(f"{package}.action"), name)
        self.client = rclpy.action.ActionClient(node, self.spec, self.name)
        self._cancel_all = node.create_client(CancelGoal, f"{self.name}/_action/cancel_goal")
        self._request = CancelGoal.Request
        self._heard = 0.0

    @property
    def heard(self) -> float:
        """When it was last there, by the monotonic clock."""
        if self.client.server_is_ready():
            self._heard = time.monotonic()
        return self._heard

    def is_connected(self, _silence: float) -> bool:
        """Whether it is there."""
        return bool(self.client.server_is_ready())

    def cancel(self) -> None:
        """Cancel all goals of all clients."""
        self._cancel_all.call_async(self._request())


class Ros2Worker(SkillWorker):
    """Performs skills over ROS 2."""

    def connect(self, start: Message) -> bool:
        """Start our node, and a client for each server; an earlier worker that died leaves no sign."""
        self.graph = Ros2Graph(start["node"])
        actions = start["actions"]
        self.servers = {skill: Ros2Server(self.graph.ours, action) for skill, action in actions.items()}
        return False

    def send(self, goal: Goal, arguments: list[Any]) -> None:
        """Send a goal."""
        message = goal.server.spec.Goal()
        for field, value in zip(goal.server.fields, arguments):
            setattr(message, field, value)
        goal.sent = time.monotonic()
        sending = goal.server.client.send_goal_async(
            message, feedback_callback=lambda m: self._feedback(goal, m.feedback)
        )
        sending.add_done_callback(lambda done: self._answered(goal, done.result()))

    def _answered(self, goal: Goal, handle: Any) -> None:
        """Note whether the server accepts the goal; one that was cancelled meanwhile is cancelled now."""
        goal.is_acknowledged = True
        if not handle.accepted:
            self.end(goal, "cancelled" if goal.cancelled else "error", state="rejected", text="")
            return
        with goal.lock:
            goal.handle = handle
            goal.stop = handle.cancel_goal_async
            if goal.cancelled is not None:
                goal.stop()
        handle.get_result_async().add_done_callback(lambda done: self._done(goal, done.result()))

    def _done(self, goal: Goal, response: Any) -> None:
        if goal.cancelled is not None or response.status == CANCELED:
            self.end(goal, "cancelled")
        elif response.status == SUCCEEDED:
            values = [getattr(response.result, field) for field in goal.server.returns]
            self.end(goal, "result", value=values[0] if values else None)
        elif response.status == ABORTED:
            self.end(goal, "error", state="aborted", text="")
        else:
            self.end(
                goal, "lost", text=f"{goal.server.name} ended its goal with the status {response.status}"
            )

    def _feedback(self, goal: Goal, feedback: Any) -> None:
        self.pass_on(goal, {name: getattr(feedback, name) for name in feedback.get_fields_and_field_types()})


if __name__ == "__main__":
    serve(Ros2Worker)
