"""The worker of a robot that offers skills: real action servers on a ROS 1 graph, by a Python that has rospy.

What a skill does is decided on the other side of the channel: each goal and each cancel is told there, and
how a goal ends is heard from there. Where no master answers, it starts one that ends with this process.
"""

from __future__ import annotations

import socket
import threading
from typing import Any

from channel import Channel, Message, NotReadyError, main
from graph import Graph, no_master
from message_types import message_types
from pictures import Camera, Show


class Servers:
    """The action servers.

    Args:
        channel: to the robot.
        start: the first line: the `node`, the `actions` by skill, and the `port` on which a master may be
            started, or null; perhaps the topic of a `camera`, whose last picture can then be asked for, and
            whether the servers `show` what they see.
    """

    def __init__(self, channel: Channel, start: Message) -> None:
        import actionlib

        self.channel = channel
        self.graph = Graph(start["node"])
        self.master = None if self.graph.is_online() else started_master(start["port"], self.graph.uri)
        self.graph.enter()
        self.handles: dict[str, Any] = {}
        self.shows: dict[str, Show] = {}
        self.camera = Camera(start["camera"]) if start.get("camera") else None
        self.lock = threading.Lock()
        specs = message_types(list(start["actions"].values()))
        self.servers: list[Any] = []
        for skill, action in start["actions"].items():
            spec = specs[action["type"]]
            server = actionlib.ActionServer(
                action["server"], spec, self._starter(skill), self._cancel, auto_start=False
            )
            server.start()
            self.servers.append(server)
            if start.get("show"):
                self.shows[skill] = Show(action["server"])
        channel.tell("ready", address=self.graph.uri, has_master=self.master is not None)

    def obey(self, line: Message) -> None:
        """End a goal as the line says, or look."""
        if line["do"] == "look":
            assert self.camera is not None, "there is no camera"
            self.channel.tell("image", **self.camera.look(line["oldest"]))
            return
        with self.lock:
            handle = self.handles.pop(line["id"])
        if "picture" in line:
            self.shows[line["skill"]].show(line["picture"])
        result = handle.get_default_result()
        if line["do"] == "succeed":
            if result.__slots__:
                setattr(result, result.__slots__[0], line["value"])
            handle.set_succeeded(result)
        elif line["do"] == "abort":
            handle.set_aborted(result, line["text"])
        elif line["do"] == "cancelled":
            handle.set_canceled(result, "cancelled")

    def leave(self) -> None:
        """Leave the graph, and take the master along."""
        import rospy

        rospy.signal_shutdown("the end")
        if self.master is not None:
            self.master.stop()

    def _starter(self, skill: str) -> Any:
        def start(handle: Any) -> None:
            goal, number = handle.get_goal(), handle.get_goal_id().id
            with self.lock:
                self.handles[number] = handle
            handle.set_accepted()
            arguments = [getattr(goal, field) for field in goal.__slots__]
            self.channel.tell("goal", id=number, skill=skill, arguments=arguments)

        return start

    def _cancel(self, handle: Any) -> None:
        self.channel.tell("cancel", id=handle.get_goal_id().id)


def started_master(port: Any, uri: str) -> Any:
    """A master in this process.

    Raises:
        NotReadyError: it may not be started, or the port is taken.
    """
    if port is None:
        raise NotReadyError(no_master(uri))
    import rosmaster.master

    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            raise NotReadyError(
                f"port {port} is taken by what is no ROS master ({error}); name another one with --port"
            ) from None
    master = rosmaster.master.Master(port)
    master.start()
    return master


if __name__ == "__main__":
    main(Servers)
