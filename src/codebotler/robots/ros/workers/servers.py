"""Action servers of a virtual robot on ROS 1, run by a Python that has rospy. CodeBotler performs goals."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from typing import Any

from channel import Channel, Fields, SetupError, serve
from graph import Ros1Graph, no_master
from message_types import action_types


class ActionServers:
    """Offers a ROS 1 action server for each skill, and starts a ROS master if none answers.

    The first message contains the `node` name, the `actions` by skill, and the `port` for a master, or null.
    """

    def __init__(self, channel: Channel, start: Fields) -> None:
        import actionlib

        self.channel = channel
        self.graph = Ros1Graph(start["node"])
        self.master = None if self.graph.is_online() else start_master(start["port"], self.graph.uri)
        self.graph.enter()
        self.handles: dict[str, Any] = {}
        self.lock = threading.Lock()
        specs = action_types(list(start["actions"].values()))
        self.servers: list[Any] = []
        for skill, action in start["actions"].items():
            name, spec, start_goal = action["server"], specs[action["type"]], self._make_callback(skill)
            server = actionlib.ActionServer(name, spec, start_goal, self._cancel, auto_start=False)
            server.start()
            self.servers.append(server)
        channel.send("ready", has_master=self.master is not None)

    def obey(self, line: Fields) -> None:
        """End a goal as succeeded, aborted or cancelled, as a message from CodeBotler says."""
        with self.lock:
            handle = self.handles.pop(line["id"])
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
        """Leave the ROS graph, and stop the master if we started it."""
        self.graph.leave()
        if self.master is not None:
            self.master.stop()

    def _make_callback(self, skill: str) -> Callable[[Any], None]:
        def start(handle: Any) -> None:
            goal, number = handle.get_goal(), handle.get_goal_id().id
            with self.lock:
                self.handles[number] = handle
            handle.set_accepted()
            arguments = [getattr(goal, field) for field in goal.__slots__]
            self.channel.send("goal", id=number, skill=skill, arguments=arguments)

        return start

    def _cancel(self, handle: Any) -> None:
        self.channel.send("cancel", id=handle.get_goal_id().id)


def start_master(port: int | None, uri: str) -> Any:
    """Start a ROS master in this process. Raise SetupError if `port` is None or already in use."""
    if port is None:
        raise SetupError(no_master(uri))
    import rosmaster.master

    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError as error:
            why = f"port {port} is in use by something that is not a ROS master ({error})"
            raise SetupError(f"{why}; name another port in ROS_MASTER_URI") from None
    master = rosmaster.master.Master(port)
    master.start()
    return master


if __name__ == "__main__":
    serve(ActionServers)
