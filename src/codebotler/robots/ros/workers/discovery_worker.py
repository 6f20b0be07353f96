"""List the offers of a robot's nodes, under a Python that has rclpy or rospy."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from typing import Any, Iterator, Tuple

from channel import Channel, Fields, SetupError, serve

QUIET_SECONDS = 2.0  # discovery ends after this many seconds without new offers
MAX_DISCOVERY_SECONDS = 10.0
Offer = Tuple[str, str, str]  # the kind (action, service, sends or hears), the name and the type


class DiscoveryWorker:
    """Sends all offers in its first message. The message it receives says whether `robot` is ros1 or ros2."""

    def __init__(self, channel: Channel, start: Fields) -> None:
        offers = set(offers_on_ros1()) if start["robot"] == "ros1" else offers_on_ros2()
        channel.send("ready", offers=sorted(offers))

    def leave(self) -> None:
        """Do nothing, because the node ends with the process."""


def offers_on_ros2() -> set[Offer]:
    """Collect the offers of all nodes until no new offers appear."""
    import rclpy

    rclpy.init(args=None)
    node = rclpy.create_node(f"codebotler_discovers_{os.getpid()}")
    offers: set[Offer] = set()
    start = change = now = time.monotonic()
    while now - start < MAX_DISCOVERY_SECONDS and (now - change < QUIET_SECONDS or not offers):
        time.sleep(0.1)
        now, before = time.monotonic(), len(offers)
        offers.update(_offers_of_others(node))
        change = now if len(offers) > before else change
    return offers


def _offers_of_others(node: Any) -> Iterator[Offer]:
    from rclpy.action import get_action_server_names_and_types_by_node

    questions = {
        "action": lambda *other: get_action_server_names_and_types_by_node(node, *other),
        "service": node.get_service_names_and_types_by_node,
        "sends": node.get_publisher_names_and_types_by_node,
        "hears": node.get_subscriber_names_and_types_by_node,
    }
    for other in node.get_node_names_and_namespaces():
        for kind, ask in questions.items() if other[0] != node.get_name() else ():
            with suppress(Exception):  # rclpy raises various errors for a node that has just left
                yield from ((kind, name, types[0]) for name, types in ask(*other))


def offers_on_ros1() -> Iterator[Offer]:
    """Yield the offers registered at the master, which does not know the types of services."""
    import rosgraph

    from graph import Ros1Graph, no_master

    graph = Ros1Graph("codebotler_discovers")  # asking the master does not require a registered node
    if not graph.is_online():
        raise SetupError(no_master(graph.uri))
    master = rosgraph.Master(graph.node)
    types = dict(master.getTopicTypes())
    for kind, names in zip(("sends", "hears", "service"), master.getSystemState()):
        for name, _ in names:
            of = types.get(name, "unknown")
            yield kind, name, of
            if kind == "hears" and name.endswith("/goal") and of.endswith("ActionGoal"):
                yield "action", name[: -len("/goal")], of[: -len("ActionGoal")]


if __name__ == "__main__":
    serve(DiscoveryWorker)
