"""List the actions, services and topics of a robot's nodes on ROS 2, under a Python that has rclpy."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from typing import Any, Iterator, Tuple

from channel import Channel, Fields, serve

QUIET_SECONDS = 2.0  # discovery ends after this many seconds without new offers
MAX_DISCOVERY_SECONDS = 10.0
Offer = Tuple[str, str, str]  # the kind (action, service, sends or hears), the name and the type


class DiscoveryWorker:
    """A worker whose first message lists the actions, services and topics of all the robot's nodes."""

    def __init__(self, channel: Channel, _start: Fields) -> None:
        channel.send("ready", offers=sorted(find_offers()))

    def leave(self) -> None:
        """Do nothing, because the node ends with the process."""


def find_offers() -> set[Offer]:
    """Return the kind, name and type of what other nodes offer, once no new offers appear or after 10 s."""
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


if __name__ == "__main__":
    serve(DiscoveryWorker)
