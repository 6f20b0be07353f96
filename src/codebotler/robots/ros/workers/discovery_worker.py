"""Lists what a robot's nodes offer: `python3 discovery_worker.py`, by a Python that has rclpy or rospy."""

from __future__ import annotations

import io
import os
import socket
import time
from contextlib import suppress
from typing import Any, Iterator, Tuple
from urllib.parse import urlsplit

from channel import Channel, Message, SetupError, serve

QUIET, FIRST = 2.0, 10.0  # seconds without anything new, after which discovery has ended; without anything at all
ANSWERS = 1.0  # seconds for a service of ROS 1 to name its type
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
    changed = now = time.monotonic()
    while now - changed < (QUIET if offers else FIRST):
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
    """All offers that the master knows."""
    import rosgraph

    from graph import Ros1Graph, no_master

    graph = Ros1Graph("codebotler_discovers")  # never entered: the master answers everybody
    if not graph.is_online():
        raise SetupError(no_master(graph.uri))
    master = rosgraph.Master(graph.node)
    types = dict(master.getTopicTypes())
    sent, heard, services = master.getSystemState()
    yield from (("sends", name, types.get(name, "*")) for name, _ in sent)
    for name, _ in heard:
        yield "hears", name, types.get(name, "*")
        if name.endswith("/goal") and types.get(name, "*").endswith("ActionGoal"):
            yield "action", name[: -len("/goal")], types[name][: -len("ActionGoal")]
    yield from (("service", name, _type_of(master, name)) for name, _ in services)


def _type_of(master: Any, service: str) -> str:
    """The type that a service of ROS 1 answers with; * if it does not answer."""
    from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header

    probe = {"probe": "1", "md5sum": "*", "callerid": "/codebotler_discovers", "service": service}
    with suppress(Exception):  # rosgraph has several errors for a node that has died
        address = urlsplit(master.lookupService(service))
        with socket.create_connection((address.hostname, address.port), ANSWERS) as stream:
            write_ros_handshake_header(stream, probe)
            return str(read_ros_handshake_header(stream, io.BytesIO(), 2048)["type"])
    return "*"


if __name__ == "__main__":
    serve(DiscoveryWorker)
