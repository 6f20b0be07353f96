"""A guard, seen from outside: it says for a tool that was killed what stops the robot."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

SCRIPT = Path(__file__).with_name("rosbridge_guard.py")
LEAVES = 3.0  # seconds that it may take to end by itself


class Guard:
    """A process that outlives this one for a moment; Ctrl-C and the end of the terminal do not reach it.

    Args:
        address: of the rosbridge.
        opening: what is to be said there first.
    """

    def __init__(self, address: str, opening: Sequence[Mapping[str, Any]]) -> None:
        self._writing = threading.Lock()
        self._process = subprocess.Popen(  # noqa: S603 - our own file
            [sys.executable, str(SCRIPT)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            text=True,
            start_new_session=True,
        )
        self._tell({"address": address, "opening": opening})

    def watch(self, message: Mapping[str, Any] | None) -> None:
        """Have a message said if this process ends now; None if nothing goes on."""
        self._tell(message)

    def leave(self) -> None:
        """End it, with nothing said."""
        self._tell(None)
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(LEAVES)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _tell(self, what: object) -> None:
        """Write a line; in vain if it has died."""
        assert self._process.stdin is not None
        with self._writing, suppress(OSError):
            self._process.stdin.write(json.dumps(what) + "\n")
            self._process.stdin.flush()
