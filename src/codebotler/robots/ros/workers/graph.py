"""Our node on the ROS 1 graph, and what the master knows about other nodes."""

from __future__ import annotations

import socket
import time
import xmlrpc.client
from typing import Any

from channel import SetupError
from message_types import OFFER_NAMES, provider_word, split_type

ROS1_EXIT_SECONDS = 3.0  # the time limit for a worker to exit if its CodeBotler was just killed
MASTER_SECONDS, NODE_SECONDS = 5.0, 2.0  # the time limits for answers from the master and from nodes


class Ros1Graph:
    """Our node on ROS 1, whose unique name reserves the robot. Also asks the master about other nodes."""

    def __init__(self, name: str) -> None:
        import netifaces  # noqa: F401 - if it is missing, fail here rather than later in a thread of rosgraph
        import rosgraph

        self.node = rosgraph.names.resolve_name(name, rosgraph.names.get_ros_namespace())
        self.uri = rosgraph.get_master_uri()
        self._master = rosgraph.Master(self.node)
        self._rosgraph = rosgraph

    def enter(self) -> bool:
        """Register our node. Return whether a dead node had its name. Raise SetupError if a live one has."""
        import rospy

        if not self.is_online():
            raise SetupError(no_master(self.uri))
        deadline = time.monotonic() + ROS1_EXIT_SECONDS
        while (address := self.address_of(self.node)) is not None and is_alive(address):
            if time.monotonic() > deadline:
                where = f"the node {self.node} at {address}"
                raise SetupError(f"another codebotler is using this robot ({where}); stop it first")
            time.sleep(0.1)
        name = self.node.rpartition("/")[2]
        rospy.init_node(name, argv=[], disable_signals=True, log_level=rospy.FATAL, anonymous=False)
        return address is not None

    def leave(self) -> None:
        """Unregister our node from the master."""
        import rospy

        rospy.signal_shutdown("the end")

    def has_left(self) -> bool:
        """Return whether our node has ended, for example because another node registered the same name."""
        import rospy

        return bool(rospy.is_shutdown())

    def is_online(self) -> bool:
        """Return whether the master answers."""
        before = socket.getdefaulttimeout()
        socket.setdefaulttimeout(MASTER_SECONDS)
        try:
            return bool(self._rosgraph.is_master_online(self.uri))
        finally:
            socket.setdefaulttimeout(before)

    def address_of(self, node: str) -> str | None:
        """Return the address of a node, or None if the master does not know the node."""
        try:
            return str(self._master.lookupNode(node))
        except self._rosgraph.MasterException:
            return None

    def explain_end(self) -> str:
        """Return a sentence that says why our node has ended. Call this if `has_left` is true."""
        return f"another node called {self.node} has taken over; stop it, and connect again"

    def nodes_of(self, server: str) -> list[str]:
        """Return the names of nodes registered for an action, a topic or a service, even if they are dead."""
        _, subscribers, services = self._master.getSystemState()
        name = self._rosgraph.names.resolve_name(server, self.node)
        names = {name, name + "/goal"}
        return [node for one, nodes in subscribers + services if one in names for node in nodes]

    def has_publisher(self, topic: str) -> bool:
        """Return whether a publisher is registered for a topic."""
        name = self._rosgraph.names.resolve_name(topic, self.node)
        return name in (one for one, _ in self._master.getSystemState()[0])

    def explain_missing(self, server: str, type_name: str) -> str:
        """Return a message that explains why a server cannot be reached."""
        if not self.is_online():
            return f"{server} is gone, and so is the ROS master at {self.uri}; start both again"
        if self.address_of(self.node) is None:
            return f"the ROS master at {self.uri} was restarted; connect again"
        nodes = self.nodes_of(server)
        what = provider_word(type_name)
        if not nodes:
            return f"there is no {what} at {server}; start it"
        address = self.address_of(nodes[0])
        if address is None or not is_alive(address):
            return f"the {what} at {server} (node {nodes[0]}) has died; start it again"
        whole, goal = "/".join(split_type(type_name)), ""
        if what == OFFER_NAMES["action"]:
            whole, goal = whole + "Action", "Goal"
        return (
            f"the {what} at {server} (node {nodes[0]}) is running, but does not accept our "
            f"messages: its definition of {whole} differs (another md5; compare with `rosmsg md5 "
            f"{whole}{goal}`), or its machine cannot be reached (see ROS_IP and ROS_HOSTNAME)"
        )


def no_master(uri: str) -> str:
    """Return the message for a ROS master that does not answer at the address `uri`."""
    return f"no ROS master answers at {uri}; start one (roscore), or set ROS_MASTER_URI"


class _ShortTimeout(xmlrpc.client.Transport):
    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = NODE_SECONDS
        return connection


def is_alive(address: str) -> bool:
    """Return whether the node at an address answers."""
    try:
        xmlrpc.client.ServerProxy(address, transport=_ShortTimeout()).getPid("/codebotler")
    except (OSError, xmlrpc.client.Error):
        return False
    return True
