"""One isolated process, seen from outside: frames in and out, and its end."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

from codebotler.simulator.sandbox.channel import HEADER, MAX_FRAME

LONGEST = 120.0  # seconds; nothing that computes takes so long, so a child that does only waits
SILENCE = 1.0  # seconds after which a silent child is looked at


class Child:
    """One isolated process, seen from outside.

    Args:
        pid: its process id, which stays its own until the next run.
        channel: the socket to it.
        wait: waits for its end and returns its exit status, or minus the signal.
    """

    def __init__(self, pid: int, channel: socket.socket, wait: Callable[[], int]) -> None:
        self.pid, self._channel, self._wait = pid, channel, wait
        self._buffer = b""
        self._deadline = time.monotonic() + LONGEST

    def send(self, message: object) -> None:
        """Send a frame; a child that is gone is noticed when it is listened to.

        Raises:
            TimeoutError: the child waits for something else than to listen.
        """
        data = json.dumps(message).encode()
        rest = memoryview(struct.pack(">I", len(data)) + data)
        stuck = Stuck(self.pid)
        self._channel.settimeout(SILENCE)
        while rest:
            self._check_time()
            try:
                rest = rest[self._channel.send(rest) :]
            except TimeoutError:
                stuck.check()
            except OSError:
                return

    def receive(self) -> object:
        """The child's next message; None when it has hung up.

        Raises:
            ProtocolError: it is none.
            TimeoutError: the child waits for something that will never come.
        """
        stuck = Stuck(self.pid)
        self._channel.settimeout(SILENCE)
        while True:
            if len(self._buffer) >= HEADER:
                end = HEADER + int.from_bytes(self._buffer[:HEADER], "big")
                if end - HEADER > MAX_FRAME:
                    raise ProtocolError("a frame is too long")
                if len(self._buffer) >= end:
                    frame, self._buffer = self._buffer[HEADER:end], self._buffer[end:]
                    return _parsed(frame)
            self._check_time()
            try:
                piece = self._channel.recv(1 << 16)
            except TimeoutError:
                stuck.check()
                continue
            except OSError:
                return None
            if not piece:
                return None
            self._buffer += piece

    def _check_time(self) -> None:
        if time.monotonic() > self._deadline:
            raise TimeoutError

    def end(self) -> int:
        """End it, if it has not ended, and return its exit status, or minus the signal."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)
        try:
            return self._wait()
        finally:
            self._channel.close()

    def ended(self) -> int:
        """Wait a moment for it to end by itself; then like `end`."""
        for _ in range(50):
            if _state(self.pid) in (None, "Z"):
                break
            threading.Event().wait(0.002)
        return self.end()


def _parsed(frame: bytes) -> object:
    try:
        message: object = json.loads(frame)
    except (ValueError, RecursionError):
        message = None
    if message is None:
        raise ProtocolError("a frame says nothing")
    return message


class Stuck:
    """Tells a child that waits for nothing from one that computes: it sleeps and uses no processor time.

    Args:
        pid: the child's process id.
    """

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._used: float | None = None

    def check(self) -> None:
        """Compare with the last check.

        Raises:
            TimeoutError: it slept both times and has not used any processor time between them.
        """
        used = _processor_time(self._pid) if _state(self._pid) == "S" else None
        if used is not None and used == self._used:
            raise TimeoutError
        self._used = used


def _stat(pid: int) -> list[str]:
    try:
        return (
            Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        )
    except OSError:
        return []


def _state(pid: int) -> str | None:
    fields = _stat(pid)
    return fields[0] if fields else None


def _processor_time(pid: int) -> float | None:
    fields = _stat(pid)
    return float(int(fields[11]) + int(fields[12])) if fields else None


class LostChildError(Exception):
    """A child ended before it could close its walls, through no fault of the program."""


class ProtocolError(Exception):
    """The program has got hold of the channel and says what the child never would."""
