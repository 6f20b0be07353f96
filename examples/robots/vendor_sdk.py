"""A stand-in for the SDK of a robot's vendor: commands as lines of JSON over TCP.

Use your vendor's package instead; `sdk_robot.py` shows how.
"""

import json
import socket
import threading


class Connection:
    """A connection to the robot's controller, which answers one command after the other."""

    def __init__(self, host: str, port: int) -> None:
        self.address = host, port
        self._socket = socket.create_connection(self.address)
        self._lines = self._socket.makefile("rw", encoding="utf-8")
        self._lock = threading.Lock()

    def command(self, name: str, *arguments: object) -> object:
        """Send a command and wait for its result; raise a RuntimeError with the controller's message."""
        with self._lock:
            self._lines.write(json.dumps([name, *arguments]) + "\n")
            self._lines.flush()
            ended = json.loads(self._lines.readline() or '{"error": "the controller is gone"}')
        if "error" in ended:
            raise RuntimeError(ended["error"])
        result: object = ended.get("result")
        return result

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
