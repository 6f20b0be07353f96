"""The ROS 1 graph as its master knows it."""

from __future__ import annotations

import socket
import time
import xmlrpc.client
from typing import Any

from channel import NotReadyError
from message_types import PACKAGE

TICK = 0.1  # seconds between two looks of the watchdog
LEAVES = 3.0  # seconds for another worker to end, whose tool has just been killed


class Graph:
    """The ROS graph, as its master knows it.

    Args:
        name: of our node; whoever has it drives the robot.
    """

    def __init__(self, name: str) -> None:
        import netifaces  # noqa: F401 - rosgraph needs it only when it connects, and then it is lost in a thread
        import rosgraph

        self.node = rosgraph.names.resolve_name(name, rosgraph.names.get_ros_namespace())
        self.uri = rosgraph.get_master_uri()
        self._master = rosgraph.Master(self.node)
        self._rosgraph = rosgraph

    def enter(self) -> bool:
        """Become a node; whether another one of the same name had died without leaving.

        Raises:
            NotReadyError: there is no master, or somebody else drives the robot.
        """
        import rospy

        if not self.is_online():
            raise NotReadyError(no_master(self.uri))
        until = time.monotonic() + LEAVES
        while (address := self.address_of(self.node)) is not None and is_alive(address):
            if time.monotonic() > until:
                raise NotReadyError(
                    f"another codebotler has this robot: the node {self.node} at {address} is there; "
                    "stop that one first"
                )
            time.sleep(TICK)
        rospy.init_node(
            self.node.rpartition("/")[2],
            argv=[],
            disable_signals=True,
            log_level=rospy.FATAL,
            anonymous=False,
        )
        return address is not None

    def leave(self) -> None:
        """Be a node no more."""
        import rospy

        rospy.signal_shutdown("the end")

    def is_left(self) -> bool:
        """Whether this is a node no more; the master ends one when another of its name comes."""
        import rospy

        return bool(rospy.is_shutdown())

    def is_online(self) -> bool:
        """Whether the master answers."""
        before = socket.getdefaulttimeout()
        socket.setdefaulttimeout(5.0)
        try:
            return bool(self._rosgraph.is_master_online(self.uri))
        finally:
            socket.setdefaulttimeout(before)

    def address_of(self, node: str) -> str | None:
        """Where a node is, as far as the master knows."""
        try:
            return str(self._master.lookupNode(node))
        except self._rosgraph.MasterException:
            return None

    def is_taken(self) -> bool:
        """Whether another node has our name."""
        import rospy

        if self.is_left() or not self.is_online():
            return self.is_left()
        address = self.address_of(self.node)
        return address not in (None, rospy.get_node_uri()) and is_alive(str(address))

    def is_forgotten(self) -> bool:
        """Whether the master answers, but knows nobody of our name; one that was started anew does not."""
        import rospy

        if self.is_taken() or not self.is_online():
            return False
        return bool(self.address_of(self.node) != rospy.get_node_uri())

    def nodes_of(self, server: str) -> list[str]:
        """The nodes that say they take the goals of an action server; they may have died."""
        _, subscribers, _ = self._master.getSystemState()
        return [node for topic, names in subscribers if topic == server + "/goal" for node in names]

    def why_missing(self, server: str, type_name: str) -> str:
        """Why there is no connection with an action server."""
        if not self.is_online():
            return f"{server} is gone, and so is the ROS master at {self.uri}; start it again"
        if self.is_taken():
            return taken_over(self.node)
        if self.is_forgotten():
            return f"the ROS master at {self.uri} was started anew; connect again"
        nodes = self.nodes_of(server)
        if not nodes:
            return f"there is no action server at {server}; start it"
        address = self.address_of(nodes[0])
        if address is None or not is_alive(address):
            return f"the action server at {server} (node {nodes[0]}) has died; start it again"
        action = f"{PACKAGE}/{type_name}Action"
        return (
            f"the action server at {server} (node {nodes[0]}) is there, but does not take our messages: its "
            f"definition of {action} differs (another md5; compare with `rosmsg md5 {action}Goal`), or its "
            "machine cannot be reached (see ROS_IP and ROS_HOSTNAME)"
        )


def taken_over(node: str) -> str:
    """What to say where another node has our name."""
    return f"another node called {node} has taken over; let that one end, and connect again"


def no_master(uri: str) -> str:
    """What to say where no master answers."""
    return f"no ROS master answers at {uri}; start one (roscore), or set ROS_MASTER_URI"


class _Hasty(xmlrpc.client.Transport):
    """A transport that does not wait for a machine that is gone."""

    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = 2.0
        return connection


def is_alive(address: str) -> bool:
    """Whether a node answers."""
    try:
        xmlrpc.client.ServerProxy(address, transport=_Hasty()).getPid("/codebotler")
    except (OSError, xmlrpc.client.Error):
        return False
    return True
