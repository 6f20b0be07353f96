"""Nodes and workers on ROS in processes of their own, forked from one that has imported ROS."""

from __future__ import annotations

import importlib
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from io import TextIOWrapper
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from forked import Forked, Server, serve

SERVERS: dict[str, Server] = {}
"""The process from which scripts are forked, by their interpreter."""
MODULES = (
    *("actionlib", "actionlib_msgs.msg", "genpy.dynamic", "move_base_msgs.msg", "rosmaster.master", "rospy"),
    *("action_msgs.msg", "action_msgs.srv", "rclpy", "rclpy.action", "rclpy.executors", "rclpy.qos"),
    *("geometry_msgs.msg", "nav_msgs.msg", "sensor_msgs.msg", "std_msgs.msg", "std_srvs.srv", "tf2_msgs.msg"),
)
"""What scripts on ROS 1 or ROS 2 import; what is not there, they find missing themselves."""
FROM_WHEELS = ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
"""What ROS from wheels sets when it starts Python a second time."""


class Node(Forked):
    """A script with its arguments, started with the options of `subprocess.Popen`.

    Args:
        command: the interpreter, the script and its arguments.
        env: all its variables.
        stderr: a pipe; without one, its errors go where those of the tests go.
        errors: how to decode bytes that are no text.
        start_new_session: whether it leads a session of its own.
        others: the options for pipes of text as its input and output.
    """

    def __init__(
        self,
        command: Sequence[str],
        *,
        env: dict[str, str],
        stderr: int | None = None,
        errors: str = "strict",
        start_new_session: bool = False,
        **others: Any,  # noqa: ANN401 - those of another class
    ) -> None:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        assert {"encoding": "utf-8", **others} == {"encoding": "utf-8", **pipes}
        python, *words = command
        with os.fdopen(os.dup(2), "w") as ours:
            super().__init__(
                *words,
                cwd=Path.cwd(),
                environment=env,
                stderr=ours if stderr is None else None,
                preload=(),
                server=SERVERS[python],
                own_session=start_new_session,
            )
        for stream in (self.stdin, self.stdout, self.stderr):
            if isinstance(stream, TextIOWrapper):
                stream.reconfigure(errors=errors)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def wait(self, timeout: float | None = None) -> int:
        """Return its status, when it has ended."""
        try:
            return super().wait(600 if timeout is None else timeout)
        except TimeoutError:
            raise subprocess.TimeoutExpired("a forked script", timeout or 600) from None


def start(command: Sequence[str], **options: Any) -> Node | subprocess.Popen[str]:  # noqa: ANN401 - those of Popen
    """Start a script in an interpreter with ROS; another command starts as usual."""
    python, *words = command
    is_ours = python in SERVERS and words[0].endswith(".py")
    return Node(command, **options) if is_ours else subprocess.Popen(command, **options)


@contextmanager
def forking(python: str) -> Iterator[None]:
    """Let the tests and their robots fork all scripts for an interpreter."""
    import pytest  # noqa: PLC0415 - the interpreter with ROS may lack it

    from codebotler.core.skills.paper import SKILLS  # noqa: PLC0415 - it lacks this, too
    from codebotler.robots.ros.worker import WORKERS_FOLDER  # noqa: PLC0415 - and this

    actions = [{"type": s.ros.type, "definition": s.ros.definition} for s in SKILLS.rows if s.ros is not None]
    SERVERS[python] = Server(command=(python, __file__, str(WORKERS_FOLDER), json.dumps(actions)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "codebotler.robots.ros.worker.subprocess", SimpleNamespace(**{**vars(subprocess), "Popen": start})
        )
        yield
    SERVERS.pop(python).end()


# --- in the process that forks


def generate_types(folder: str, actions: str) -> None:
    """Generate the messages of the paper's skills on ROS 1, so that no other process needs to."""
    sys.path.insert(0, folder)
    message_types: Any = importlib.import_module("message_types")
    message_types.generate_type = lru_cache(None)(message_types.generate_type)
    message_types.action_types(json.loads(actions))
    sys.path.remove(folder)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    set_before = {name: os.environ[name] for name in FROM_WHEELS if name in os.environ}
    for module in MODULES:
        with suppress(ImportError):
            importlib.import_module(module)
    if "rospy" in sys.modules:
        generate_types(*sys.argv[1:3])
    sys.path.remove(str(Path(__file__).resolve().parent))
    with socket.socket(fileno=int(sys.argv[3])) as door:
        called = serve(door)
    if called is not None:
        os.environ.update(set_before)
        runpy.run_path(called[0], run_name="__main__")
