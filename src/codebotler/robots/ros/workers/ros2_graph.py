"""Our node on the ROS 2 graph, on which nodes discover each other without a master."""

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
from message_types import as_data, provider_word
from ros2_types import message_types

DISCOVERY_SECONDS = 1.0  # the time a new node needs to discover most other nodes
ANSWER_SECONDS_ROS2 = 2.0  # the time limit for an answer from another node with our name
ROS2_EXIT_SECONDS = 3.0  # the time limit for a worker to exit if its CodeBotler was just killed
NODE_IN_USE = "another codebotler is using this robot (the node {}); stop it first"


class Ros2Graph:
    """Our node on ROS 2, whose executor runs in a thread. Its unique name reserves the robot."""

    def __init__(self, name: str, taken: str = NODE_IN_USE) -> None:
        import rclpy
        import rclpy.executors
        from rclpy.signals import SignalHandlerOptions

        self._rclpy, self.node, self._taken = rclpy, name, taken
        self._is_left_behind = self._has_ended = False
        # No signal handlers, because the worker must stop the robot before rclpy shuts down.
        rclpy.init(args=None, signal_handler_options=SignalHandlerOptions.NO)

    def enter(self, *, is_rescue: bool = False) -> bool:
        """Start our node. Return whether a dead node had its name. Raise SetupError if a live one has.

        If workers on two machines start at the same time, both notice this and stop. With `is_rescue`, skip
        the search and return True, because CodeBotler has just killed the last worker.
        """
        self._lock = self._take_lock()
        self._is_left_behind = is_rescue or self._has_dead_twin()
        self.ours = self._rclpy.create_node(self.node)
        self.executor = self._rclpy.executors.SingleThreadedExecutor()
        self.executor.add_node(self.ours)
        return self._is_left_behind

    def _has_dead_twin(self) -> bool:
        """Return whether a dead node with our name is on the graph. Raise SetupError if a live one is."""
        probe = self._rclpy.create_node(f"{self.node}_looks_{os.getpid()}")
        time.sleep(DISCOVERY_SECONDS)
        is_there = self.node in probe.get_node_names()
        if is_there and self._answers(probe):
            self._rclpy.shutdown()
            raise SetupError(self._taken.format(self.node))
        probe.destroy_node()
        return is_there

    def spin(self) -> None:
        """Start the executor's thread. Call this only after creating all clients and servers.

        rclpy exposes partially constructed clients and servers to the executor, which would crash its thread.
        """
        self._spinning = threading.Thread(target=self._spin, daemon=True)
        self._spinning.start()

    def leave(self) -> None:
        """Destroy our node. After a shutdown alone, other nodes would see it until its lease expires."""
        self._rclpy.shutdown()
        self._spinning.join(ROS2_EXIT_SECONDS)
        for action in list(self.ours.waitables):
            action.destroy()
        self.ours.destroy_node()

    def has_left(self) -> bool:
        """Return whether our node has ended, or another node with the same name has appeared."""
        return not self._rclpy.ok() or self._has_ended or self._has_double()

    def explain_end(self) -> str:
        """Return a sentence that says why our node has ended. Call this if `has_left` is true."""
        if self._has_ended:
            return f"the node {self.node} has failed in rclpy; connect again"
        if self._rclpy.ok():
            return f"another node called {self.node} has appeared; stop it, and connect again"
        return f"the node {self.node} was shut down; connect again"

    def explain_missing(self, server: str, type_name: str) -> str:
        """Return a message that explains why a server cannot be reached."""
        mend = "start it, or compare ROS_DOMAIN_ID and the definitions on both sides"
        return f"there is no {provider_word(type_name)} of {type_name} at {server}; {mend}"

    def call_soon(self, function: Callable[..., object], *arguments: Any) -> None:
        """Schedule a function call in the executor's thread."""
        self.executor.create_task(function, *arguments)

    def resolve(self, future: Any, value: Any) -> None:
        """Set the result of a future and wake the executor."""

        def resolve() -> None:
            future.set_result(value)
            self.call_soon(lambda: None)

        self.call_soon(resolve)

    def listen(
        self, topic: str, hear: Callable[[Any], object], packages: list[str], patience: float | None
    ) -> Callable[[], object] | None:
        """Subscribe to a topic with the type that its publishers use. Return a function that unsubscribes.

        Wait up to `patience` seconds for a publisher, then raise SetupError. If `patience` is None, do not
        wait, and return None if there is no publisher.
        """
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        deadline = time.monotonic() + (patience or 0.0)
        while not (publishers := self.ours.get_publishers_info_by_topic(topic)):
            if time.monotonic() > deadline:
                if patience is None:
                    return None
                raise SetupError(f"nothing publishes {topic}; start its publisher, or correct the topic")
            time.sleep(0.05)
        kind, offered = publishers[0].topic_type, publishers[0].qos_profile
        qos = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
        if offered.durability == DurabilityPolicy.TRANSIENT_LOCAL:  # receive the latched message as well
            qos = QoSProfile(depth=10, durability=offered.durability)
        spec = message_types([kind], map(Path, packages))[kind]
        subscriptions: list[Any] = []

        def subscribe() -> None:
            subscriptions.append(self.ours.create_subscription(spec, topic, lambda m: hear(as_data(m)), qos))

        self.call_soon(subscribe)
        return lambda: self.call_soon(lambda: self.ours.destroy_subscription(subscriptions.pop()))

    def _take_lock(self) -> socket.socket:
        """Bind a socket whose name only one process on this machine can hold at a time."""
        lock = socket.socket(socket.AF_UNIX)
        deadline = time.monotonic() + ROS2_EXIT_SECONDS
        while sys.platform == "linux":
            try:
                lock.bind(f"\0codebotler ROS 2 {os.environ.get('ROS_DOMAIN_ID', '0')} {self.node}")
                break
            except OSError:
                if time.monotonic() > deadline:
                    self._rclpy.shutdown()
                    raise SetupError(self._taken.format(self.node)) from None
                time.sleep(0.1)
        return lock

    def _answers(self, probe: Any) -> bool:
        """Return whether the node with our name is alive. A dead node stays on the graph for a while."""
        from rcl_interfaces.srv import ListParameters

        client = probe.create_client(ListParameters, f"/{self.node}/list_parameters")
        if not client.wait_for_service(timeout_sec=ANSWER_SECONDS_ROS2):
            return False
        answer = client.call_async(ListParameters.Request())
        self._rclpy.spin_until_future_complete(probe, answer, timeout_sec=ANSWER_SECONDS_ROS2)
        return bool(answer.done())

    def _has_double(self) -> bool:
        if self._is_left_behind:
            return False
        with suppress(Exception):  # the node may be shutting down
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
