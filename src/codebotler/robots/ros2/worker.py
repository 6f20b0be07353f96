"""The worker for ROS 2, run by the robot's own Python (3.8 or later), which must have rclpy.

It says and does the same as that for ROS 1. It was tested against a stand-in for rclpy only, never on a ROS 2
graph: none was at hand.
"""

from __future__ import annotations

import importlib
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "ros1" / "worker"))

from channel import Message, NotReadyError, main
from goals import Goal, Ros1Worker
from message_types import PACKAGE

DISCOVERY = 1.0  # seconds after which a node knows most others
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6  # of action_msgs/msg/GoalStatus
ENDS = {CANCELED: "cancelled", ABORTED: "aborted"}


class Graph2:
    """The ROS 2 graph, which has no master.

    Args:
        name: of our node; whoever has it drives the robot.

    Raises:
        NotReadyError: somebody else has it.
    """

    uri = "the domain of ROS_DOMAIN_ID"

    def __init__(self, name: str) -> None:
        import rclpy
        import rclpy.executors

        self._rclpy, self.node = rclpy, name
        rclpy.init(args=None, **_without_signals())
        looks = rclpy.create_node(f"{name}_looks_{os.getpid()}")
        time.sleep(DISCOVERY)
        is_taken = name in looks.get_node_names()
        looks.destroy_node()
        if is_taken:
            rclpy.shutdown()
            raise NotReadyError(
                f"another codebotler has this robot: there is a node {name} on the graph; stop that one first"
            )
        self.ours = rclpy.create_node(name)
        executor = rclpy.executors.SingleThreadedExecutor()
        executor.add_node(self.ours)
        threading.Thread(target=executor.spin, daemon=True).start()

    def leave(self) -> None:
        """Be a node no more."""
        self._rclpy.shutdown()

    def is_left(self) -> bool:
        """Whether this is a node no more."""
        return not self._rclpy.ok()

    def is_taken(self) -> bool:
        """Another node of our name ends nothing here."""
        return False

    def is_forgotten(self) -> bool:
        """There is nobody who could forget us."""
        return False

    def nodes_of(self, _server: str) -> list[str]:
        """Any node may yet be discovered."""
        return ["a node to be discovered"]

    def why_missing(self, server: str, type_name: str) -> str:
        """Why there is no connection with an action server."""
        return (
            f"there is no action server of {PACKAGE}/action/{type_name} at {server}; start it, or compare "
            "ROS_DOMAIN_ID and the definitions on both sides"
        )


def _without_signals() -> dict[str, Any]:
    """What keeps rclpy, where it is new enough, from ending at a signal before the robot was stopped."""
    try:
        from rclpy.signals import SignalHandlerOptions
    except ImportError:
        return {}
    return {"signal_handler_options": SignalHandlerOptions.NO}


class Server2:
    """What the worker knows of the action server of one skill.

    Args:
        node: ours.
        action: the skill's row.
    """

    def __init__(self, node: Any, action: Message) -> None:
        import rclpy.action
        from action_msgs.srv import CancelGoal

        self.name: str = action["server"]
        self.type: str = action["type"]
        goal, result, _ = action["definition"].split("---\n")
        self.fields = [line.split()[1] for line in goal.splitlines()]
        self.returns = [line.split()[1] for line in result.splitlines()]
        self.spec = getattr(importlib.import_module(f"{PACKAGE}.action"), self.type)
        self.client = rclpy.action.ActionClient(node, self.spec, self.name)
        self._cancel_all = node.create_client(CancelGoal, f"{self.name}/_action/cancel_goal")
        self._request = CancelGoal.Request
        self._heard = 0.0

    @property
    def heard(self) -> float:
        """When it was last there, on a clock that nobody sets."""
        if self.client.server_is_ready():
            self._heard = time.monotonic()
        return self._heard

    def is_connected(self, _silence: float) -> bool:
        """Whether it is there."""
        return bool(self.client.server_is_ready())

    def cancel(self) -> None:
        """Cancel all goals of anybody."""
        self._cancel_all.call_async(self._request())


class Ros2Worker(Ros1Worker):
    """Executes skills over ROS 2, one at a time."""

    def _entered(self, node: str) -> Any:
        return Graph2(node), False

    def _servers(self, actions: Message) -> dict[str, Any]:
        return {skill: Server2(self.graph.ours, action) for skill, action in actions.items()}

    def _send(self, goal: Goal, arguments: list[Any]) -> None:
        server: Any = goal.server
        message = server.spec.Goal()
        for field, value in zip(server.fields, arguments):
            setattr(message, field, value)
        with goal.lock:
            if goal.cancelled is not None:
                self._end(goal, "cancelled")
                return
            goal.sent = time.monotonic()
            sending = server.client.send_goal_async(message, feedback_callback=lambda m: self._told(goal, m))
        sending.add_done_callback(lambda done: self._taken(goal, done.result()))

    def _taken(self, goal: Goal, handle: Any) -> None:
        """Hear whether the server takes the goal; one that was cancelled before is cancelled now."""
        goal.is_acknowledged = True
        if not handle.accepted:
            self._end(goal, "cancelled" if goal.cancelled else "error", state="rejected", text="")
            return
        with goal.lock:
            goal.handle = handle
            goal.stop = handle.cancel_goal_async
            if goal.cancelled is not None:
                goal.stop()
        handle.get_result_async().add_done_callback(lambda done: self._done(goal, done.result()))

    def _done(self, goal: Goal, response: Any) -> None:
        server: Any = goal.server
        if goal.cancelled is not None or response.status == CANCELED:
            self._end(goal, "cancelled", state=ENDS.get(response.status, ""))
        elif response.status == SUCCEEDED:
            values = [getattr(response.result, field) for field in server.returns]
            self._end(goal, "result", value=values[0] if values else None)
        elif response.status == ABORTED:
            self._end(goal, "error", state="aborted", text="")
        else:
            self._end(goal, "lost", text=f"{server.name} ended its goal with the status {response.status}")

    def _told(self, goal: Goal, message: Any) -> None:
        fields = message.feedback.get_fields_and_field_types()
        words = ", ".join(f"{name}: {getattr(message.feedback, name)}" for name in fields)
        if words and not goal.is_over:
            self.channel.tell("feedback", id=goal.number, text=words)


if __name__ == "__main__":
    main(Ros2Worker)
