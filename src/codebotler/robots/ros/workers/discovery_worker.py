"""Lists what a robot's nodes offer: `python3 discovery_worker.py`, by a Python that has rclpy or rospy."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from typing import Any, Iterator, Tuple

from channel import Channel, Message, SetupError, serve

QUIET = 2.0  # seconds without anything new, after which discovery has ended
LONGEST = 10.0  # seconds for that, also where nothing or always something new comes
Offer = Tuple[str, str, str]  # the kind (action, service, sends or hears), a name and a type


class DiscoveryWorker:
    """Sends all offers with its first message; the first line has the `robot`, ros1 or ros2."""

    def __init__(self, channel: Channel, start: Message) -> None:
        offers = set(offers_on_ros1()) if start["robot"] == "ros1" else offers_on_ros2()
        channel.send("ready", offers=sorted(offers))

    def leave(self) -> None:
        """Do nothing: nodes end with the process."""


def offers_on_ros2() -> set[Offer]:
    """All offers that are discovered until nothing new comes."""
    import rclpy

    rclpy.init(args=None)
    node = rclpy.create_node(f"codebotler_discovers_{os.getpid()}")
    offers: set[Offer] = set()
    begun = changed = now = time.monotonic()
    while now - begun < LONGEST and (now - changed < QUIET or not offers):
        time.sleep(0.1)
        now, before = time.monotonic(), len(offers)
        offers.update(_offers_of_others(node))
        changed = now if len(offers) > before else changed
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
            with suppress(Exception):  # rclpy has several errors for a node that has just left
                yield from ((kind, name, types[0]) for name, types in ask(*other))


def offers_on_ros1() -> Iterator[Offer]:
    """All offers that the master knows; it does not know the types of services."""
    import rosgraph

    from graph import Ros1Graph, no_master

    graph = Ros1Graph("codebotler_discovers")  # never entered: the master answers everybody
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
