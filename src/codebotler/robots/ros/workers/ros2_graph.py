"""The ROS 2 graph, which has no master: nodes discover each other."""

from __future__ import annotations

import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from channel import SetupError
from message_types import as_data, offer_of
from ros2_types import message_types

DISCOVERY = 1.0  # seconds after which a node knows most others
ANSWERS = 2.0  # seconds within which another node of our name answers, if it is alive
LEAVES = 3.0  # seconds for another worker to end whose tool was just killed
TAKEN = "another codebotler is using this robot (the node {}); stop it first"


class Ros2Graph:
    """Our node, whose executor runs in a thread; whoever has our node's name drives the robot."""

    def __init__(self, name: str, taken: str = TAKEN) -> None:
        import rclpy
        import rclpy.executors
        from rclpy.signals import SignalHandlerOptions

        self._rclpy, self.node, self._taken = rclpy, name, taken
        self._is_left_behind = self._has_ended = False
        rclpy.init(args=None, signal_handler_options=SignalHandlerOptions.NO)  # the robot must stop first

    def enter(self, *, is_rescue: bool = False) -> bool:
        """Start our node; whether an earlier one of its name had died without leaving.

        On one machine, no two workers pass; between machines, two that start together may, and then both
        notice each other and stop. In a rescue, which must not wait, it was the tool that killed the other.
        """
        self._lock = self._locked()
        self._is_left_behind = is_rescue or self._has_left()
        self.ours = self._rclpy.create_node(self.node)
        self.executor = self._rclpy.executors.SingleThreadedExecutor()
        self.executor.add_node(self.ours)
        return self._is_left_behind

    def _has_left(self) -> bool:
        """Whether a node of our name is on the graph, but dead; SetupError if it is alive."""
        probe = self._rclpy.create_node(f"{self.node}_looks_{os.getpid()}")
        time.sleep(DISCOVERY)
        is_there = self.node in probe.get_node_names()
        if is_there and self._answers(probe):
            self._rclpy.shutdown()
            raise SetupError(self._taken.format(self.node))
        probe.destroy_node()
        return is_there

    def spin(self) -> None:
        """Start the executor's thread, once all clients and servers are made.

        rclpy shows them to the executor before it has finished making them, which would end the thread.
        """
        self._spinning = threading.Thread(target=self._spin, daemon=True)
        self._spinning.start()

    def leave(self) -> None:
        """Destroy our node: if it were only shut down, others would see it until its lease is over."""
        self._rclpy.shutdown()
        self._spinning.join(LEAVES)
        for action in list(self.ours.waitables):
            action.destroy()
        self.ours.destroy_node()

    def is_left(self) -> bool:
        """Whether our node hears nothing any more, or another one of its name has come."""
        return not self._rclpy.ok() or self._has_ended or self._has_double()

    def why_left(self) -> str:
        """Error message for a node that must not go on."""
        if self._has_ended:
            return f"the node {self.node} has failed in rclpy; connect again"
        if self._rclpy.ok():
            return f"another node called {self.node} has come; stop it, and connect again"
        return f"the node {self.node} was shut down; connect again"

    def why_missing(self, server: str, type_name: str) -> str:
        """Why there is no connection with what a robot offers."""
        return (
            f"there is no {offer_of(type_name)} of {type_name} at {server}; start it, or compare "
            "ROS_DOMAIN_ID and the definitions on both sides"
        )

    def soon(self, does: Callable[..., object], *arguments: Any) -> None:
        """Have the executor's thread call something."""
        self.executor.create_task(does, *arguments)

    def resolve(self, future: Any, value: Any) -> None:
        """Give a future its value, and have the executor look again who waits for it."""

        def resolve() -> None:
            future.set_result(value)
            self.soon(lambda: None)

        self.soon(resolve)

    def listen(
        self, topic: str, hear: Callable[[Any], object], packages: list[str], patience: float | None
    ) -> Callable[[], object] | None:
        """Call `hear` with each message of a topic as plain data, of the type that its publishers have.

        It returns what ends that. Without `patience`, in seconds, a topic that nobody publishes is left out.
        """
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        until = time.monotonic() + (patience or 0.0)
        while not (publishers := self.ours.get_publishers_info_by_topic(topic)):
            if time.monotonic() > until:
                if patience is None:
                    return None
                raise SetupError(f"nothing publishes {topic}; start what does, or correct its name")
            time.sleep(0.05)
        kind, offered = publishers[0].topic_type, publishers[0].qos_profile
        qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        if (
            offered.durability == DurabilityPolicy.TRANSIENT_LOCAL
        ):  # the last message is sent to who comes later
            qos = QoSProfile(depth=10, durability=offered.durability)
        spec = message_types([kind], map(Path, packages))[kind]
        made: list[Any] = []

        def subscribe() -> None:
            made.append(self.ours.create_subscription(spec, topic, lambda m: hear(as_data(m)), qos))

        self.soon(subscribe)
        return lambda: self.soon(lambda: self.ours.destroy_subscription(made.pop()))

    def _locked(self) -> socket.socket:
        """A socket that only one process of this machine can have, for as long as it lives."""
        lock = socket.socket(socket.AF_UNIX)
        until = time.monotonic() + LEAVES
        while sys.platform == "linux":
            try:
                lock.bind(f"\0codebotler ROS 2 {os.environ.get('ROS_DOMAIN_ID', '0')} {self.node}")
                break
            except OSError:
                if time.monotonic() > until:
                    self._rclpy.shutdown()
                    raise SetupError(self._taken.format(self.node)) from None
                time.sleep(0.1)
        return lock

    def _answers(self, probe: Any) -> bool:
        """Whether the node of our name is alive; a dead one stays on the graph for a while."""
        from rcl_interfaces.srv import ListParameters

        client = probe.create_client(ListParameters, f"/{self.node}/list_parameters")
        if not client.wait_for_service(timeout_sec=ANSWERS):
            return False
        answer = client.call_async(ListParameters.Request())
        self._rclpy.spin_until_future_complete(probe, answer, timeout_sec=ANSWERS)
        return bool(answer.done())

    def _has_double(self) -> bool:
        if self._is_left_behind:
            return False
        with suppress(Exception):  # the node may be shut down at this moment
            return bool(self.ours.get_node_names().count(self.node) > 1)
        return False

    def _spin(self) -> None:
        from rclpy.executors import ExternalShutdownException

        try:
            self.executor.spin()
        except ExternalShutdownException:
            return
        finally:
            self._has_ended = True
