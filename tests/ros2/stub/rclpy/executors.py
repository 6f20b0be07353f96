import threading
from typing import Any


class SingleThreadedExecutor:
    def add_node(self, node: Any) -> None:
        self.node = node

    def spin(self) -> None:
        threading.Event().wait()
