"""Exchanges messages with an isolated process, detects when it is stuck, and ends it."""

from __future__ import annotations

import contextlib
import json
import marshal
import os
import signal
import socket
import struct
import time
from collections.abc import Callable
from pathlib import Path

from codebotler.core.cachedproperty import cached_property
from codebotler.simulator.process.errors import LostProcessError, ProtocolError
from codebotler.simulator.process.spawn import CHANNELS
from codebotler.simulator.sandbox import HEADER, MAX_FRAME, WITHOUT_REFERENCES

PROCESS_WAIT_SECONDS = 60.0  # total time to wait for a process; no computation takes this long
SILENCE_SECONDS = 1  # time until a silent process is examined
WHOLE_MESSAGE = 2**31 - 1  # bytes, more than any message has


class IsolatedProcess:
    """Exchanges messages with one isolated process, and can kill it."""

    def __init__(
        self,
        find_pid: Callable[[], int],  # returns the process id, which is unique until the next run
        channel: socket.socket,
        wait: Callable[[], int],  # waits, and returns the exit status or negative signal number
    ) -> None:
        self._find_pid, self._channel, self._wait = find_pid, channel, wait
        silence = struct.pack("ll", SILENCE_SECONDS, 0)
        for direction in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):  # one system call fewer than settimeout
            channel.setsockopt(socket.SOL_SOCKET, direction, silence)
        self._buffer = bytearray()
        self.wait_left = PROCESS_WAIT_SECONDS  # seconds left to wait

    @cached_property
    def pid(self) -> int:
        """The process id. Reading it raises LostProcessError if the process did not start."""
        try:
            return self._find_pid()
        except LostProcessError:
            self.close_channel()
            raise

    def send(self, message: object) -> None:
        """Send a message. Do nothing if the process has ended; the next `receive` reports that."""
        data = marshal.dumps(message, WITHOUT_REFERENCES)  # type: ignore[arg-type]  # strings, numbers and containers of them
        rest = memoryview(len(data).to_bytes(HEADER, "big") + data)
        used: int | None = None
        while rest:
            began = time.monotonic()
            try:
                rest = rest[self._channel.send(rest) :]
            except BlockingIOError:  # timed out
                used = self._check_progress(used)
            except OSError:
                return
            self._use_wait(began)

    def receive(self) -> object:
        """Return the next JSON message, or None if the process has hung up.

        Raise ProtocolError for anything else, and TimeoutError if the process is stuck.
        """
        frame = self.receive_bytes(MAX_FRAME)
        if frame is None:
            return None
        try:
            message, end = decode(str(frame, "ascii"))
        except (ValueError, RecursionError):
            message, end = None, 0
        if message is None or end < len(frame):
            raise ProtocolError("a message is not valid JSON")
        return message

    def receive_bytes(self, most: int) -> bytes | None:
        """Return the next message, or None at the end. Raise ProtocolError if it exceeds `most` bytes."""
        used: int | None = None
        while True:
            if len(self._buffer) >= HEADER:
                end = HEADER + int.from_bytes(self._buffer[:HEADER], "big")
                if end - HEADER > most:
                    raise ProtocolError(f"a message has more than {most:,} bytes")
                if len(self._buffer) >= end:
                    frame = bytes(self._buffer[HEADER:end])
                    del self._buffer[:end]
                    return frame
            began = time.monotonic()
            try:
                piece = self._channel.recv(1 << 16)
            except BlockingIOError:  # timed out
                used = self._check_progress(used)
            except OSError:
                return None
            else:
                if not piece:
                    return None
                self._buffer += piece
            self._use_wait(began)

    def _use_wait(self, since: float) -> None:
        self.wait_left -= min(time.monotonic() - since, SILENCE_SECONDS)  # any more is a delay of our own
        if self.wait_left < 0:
            raise TimeoutError

    def _check_progress(self, before: int | None) -> int | None:
        """Return a sleeping process's processor time. Raise TimeoutError if it has not changed."""
        fields = _stat(self.pid)
        used = int(fields[11]) + int(fields[12]) if fields[:1] == ["S"] else None
        if used is not None and used == before:
            raise TimeoutError
        return used

    def kill(self) -> None:
        """Kill the process without waiting for it to end."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def end(self) -> int:
        """Kill the process, and return its exit status or negative signal number."""
        self.kill()
        try:
            return self._wait()
        finally:
            self.close_channel()

    def end_gently(self) -> int:
        """Give the process 0.1 s to exit, then kill it. Return its exit status or negative signal number."""
        for _ in range(50):
            if _stat(self.pid)[:1] in ([], ["Z"]):
                break
            time.sleep(0.002)
        return self.end()

    def restart_wait(self) -> None:
        """Restart the timeout for the process (PROCESS_WAIT_SECONDS), because it has answered."""
        self.wait_left = PROCESS_WAIT_SECONDS

    def close_channel(self) -> None:
        """Close the channel to the process."""
        self._channel.close()


def channel_pair() -> tuple[socket.socket, socket.socket]:
    """Return the two ends of a new channel: ours, and the one for the process.

    On Linux, each `read` of the process returns as many bytes as it asks for, however fast we send them.
    Otherwise, the sizes of the pieces would vary and change the heap, which programs can observe.
    """
    ours, theirs = socket.socketpair()
    CHANNELS.add(ours)
    theirs.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, WHOLE_MESSAGE)
    return ours, theirs


def _stat(pid: int) -> list[str]:
    """Return the fields of /proc/PID/stat from the state on, or an empty list if the process is gone."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return []
    return stat.rpartition(")")[2].split()


# This is faster than `json.loads`, which also skips whitespace around a value.
decode: Callable[[str], tuple[object, int]] = json.JSONDecoder().raw_decode
