"""A rosbridge double for ROS 1 on a real graph, and a stand-in for rosbridge on ROS 2."""

from __future__ import annotations

import json
import os
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from codebotler.core.skills.paper import SKILLS
from codebotler.core.skills.table import SkillTable
from codebotler.robots.base import ROS_PYTHON
from codebotler.robots.ros.caller import calls_data
from codebotler.robots.ros.connections.connection import default_connection
from codebotler.robots.ros.worker import WORKERS_FOLDER
from forked_on_ros import start
from ros_graph import forget_goals

ROS_SIDE = Path(__file__).parent / "bridge_to_ros.py"


class Bridge:
    """A websocket server that handles each connection with one function.

    Args:
        handle: talks on a connection until it is closed.
    """

    def __init__(self, handle: Callable[[ServerConnection], None]) -> None:
        self.open: list[ServerConnection] = []
        self._handle = handle
        self._server = serve(self._talk, "127.0.0.1", 0)
        self.address = f"ws://127.0.0.1:{self._server.socket.getsockname()[1]}"
        forget_goals("rosbridge", self.address)
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def _talk(self, connection: ServerConnection) -> None:
        self.open.append(connection)
        with suppress(ConnectionClosed):
            self._handle(connection)
        self.open.remove(connection)

    def cut(self) -> None:
        """Break all connections."""
        for connection in list(self.open):
            connection.close_socket()

    def end(self) -> None:
        self._server.shutdown()
        self._thread.join()


@contextmanager
def bridge(handle: Callable[[ServerConnection], None]) -> Iterator[Bridge]:
    double = Bridge(handle)
    yield double
    double.cut()
    double.end()


def ros_handler(
    master: str, skills: tuple[str, ...] = tuple(SKILLS), table: SkillTable = SKILLS
) -> Callable[[ServerConnection], None]:
    """Return a function that handles each connection with a separate node on a real ROS graph.

    Args:
        master: URI of the graph's master.
        skills: names of the skills whose messages the node knows.
        table: all skills.
    """
    actions = [action for skill, action in calls_data(default_connection(table)).items() if skill in skills]

    def handle(connection: ServerConnection) -> None:
        with start(
            [str(ROS_PYTHON), str(ROS_SIDE), str(WORKERS_FOLDER), json.dumps(actions)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "ROS_MASTER_URI": master},
        ) as node:
            assert node.stdin is not None
            assert node.stdout is not None

            def forward() -> None:
                assert node.stdout is not None
                try:
                    for line in node.stdout:
                        connection.send(line)
                except ConnectionClosed:
                    node.kill()

            thread = threading.Thread(target=forward, daemon=True)
            thread.start()
            try:
                for text in connection:
                    node.stdin.write(f"{text!s}\n")
                    node.stdin.flush()
            except (ConnectionClosed, BrokenPipeError):
                pass
            finally:
                node.kill()
                node.wait()
                thread.join()

    return handle


def ros2_handler(requests: list[dict[str, Any]]) -> Callable[[ServerConnection], None]:
    """Return a function that follows the documentation of rosbridge on ROS 2; goals select their results.

    Args:
        requests: collects all requests.
    """

    def handle(connection: ServerConnection) -> None:
        def tell(operation: str, **more: object) -> None:
            connection.send(json.dumps({"op": operation, **more}))

        for text in connection:
            message = json.loads(text)
            requests.append(message)
            match message:
                case {"op": "call_service", "id": called}:
                    values = {"version": 2, "distro": "jazzy"}
                    tell("service_response", id=called, result=True, values=values)
                case {"op": "send_action_goal", "id": goal, "action": action, "args": args}:
                    word = next(iter(args.values()), "")
                    if word == "unknown":
                        tell("action_result", id=goal, action=action, values="no such action", result=False)
                    elif word.startswith("{"):
                        connection.send(word)
                    elif word != "never":
                        tell("action_feedback", id=goal, action=action, values={"near": "the hall"})
                        status = 6 if word == "abort" else 4
                        values = {"result": "yes"} if action == "/ask_server" else {}
                        tell(
                            "action_result", id=goal, action=action, values=values, status=status, result=True
                        )
                case {"op": "cancel_action_goal", "id": goal, "action": action}:
                    tell("action_result", id=goal, action=action, values={}, status=5, result=True)

    return handle
