"""A stand-in for rclpy: what the worker uses of it, as its documentation has it; goals say how they go."""

import os
import threading
from collections.abc import Callable
from typing import Any

is_on = False


def init(args: Any = None, **_options: Any) -> None:
    global is_on  # noqa: PLW0603 - rclpy is like that
    is_on = args is None


def ok() -> bool:
    return is_on


def shutdown() -> None:
    global is_on  # noqa: PLW0603 - rclpy is like that
    is_on = False


def note(*what: str) -> None:
    """Tell the test what happens."""
    with open(os.environ["NOTES"], "a", encoding="utf-8") as file:  # noqa: PTH123 - as short as can be
        file.write(" ".join(what) + "\n")


class Future:
    def __init__(self) -> None:
        self._done = threading.Event()
        self._callbacks: list[Callable[[Any], None]] = []
        self._result: Any = None

    def result(self) -> Any:
        return self._result

    def set_result(self, result: Any) -> None:
        self._result = result
        self._done.set()
        for callback in self._callbacks:
            callback(self)

    def add_done_callback(self, callback: Callable[[Any], None]) -> None:
        if self._done.is_set():
            callback(self)
        else:
            self._callbacks.append(callback)


class Client:
    def __init__(self, name: str) -> None:
        self.name = name

    def call_async(self, _request: Any) -> Future:
        note("cancel all", self.name)
        return Future()


class Node:
    def __init__(self, name: str) -> None:
        self.name = name

    def get_node_names(self) -> list[str]:
        return [self.name, *os.environ.get("NODES", "").split()]

    def destroy_node(self) -> None:
        pass

    def create_client(self, _kind: Any, name: str) -> Client:
        return Client(name)


def create_node(name: str) -> Node:
    return Node(name)
