"""One isolated process, seen from outside: frames in and out, and its end."""

from __future__ import annotations

import contextlib
import json
import marshal
import os
import signal
import socket
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path

from codebotler.core.cachedproperty import cached_property
from codebotler.core.trace import RunError, Status
from codebotler.simulator.sandbox import (
    CPU_SECONDS,
    HEADER,
    MAX_FRAME,
    MORE,
    PIECE,
    WITHOUT_REFERENCES,
)

PROCESSOR_TIME = "seconds of processor time"
"""How the sentence ends that tells of a program which computed for too long."""
LONGEST = 60.0  # seconds of waiting for a child in all; nothing that computes takes so long
FILTERED, KILLED_BY_FILTER = 2, 3  # what Linux says of a process and its list of system calls
SILENCE = 1  # seconds after which a silent child is looked at
SILENCE_FOR_KERNEL = struct.pack("ll", SILENCE, 0)


class Child:
    """One isolated process, seen from outside.

    Args:
        find_pid: tells its process id, which stays its own until the next run.
        channel: the socket to it.
        wait: waits for its end and returns its exit status, or minus the signal.
        closes: whether closing its walls can be seen from outside, which takes seccomp.
    """

    def __init__(
        self, find_pid: Callable[[], int], channel: socket.socket, wait: Callable[[], int], *, closes: bool
    ) -> None:
        self._find_pid, self._channel, self._wait = find_pid, channel, wait
        for direction in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):  # one system call less than settimeout
            channel.setsockopt(socket.SOL_SOCKET, direction, SILENCE_FOR_KERNEL)
        self._closes = closes
        self._buffer = bytearray()
        self.patience = LONGEST
        """For how many seconds it will still be waited for."""

    @cached_property
    def pid(self) -> int:
        """Its process id.

        Raises:
            LostChildError: it has none.
        """
        try:
            return self._find_pid()
        except LostChildError:
            self.hang_up()
            raise

    def send(self, message: object) -> None:
        """Send a message in one or more pieces; a child that is gone is noticed when it is listened to.

        Each piece but the last is asked for more. So a child reads pieces of sizes that depend on the message
        only, and not on how quick it was: what it reads leaves its mark on the heap.

        Raises:
            ProtocolError: the child says something else in between.
            TimeoutError: the child waits for something else than to listen.
        """
        data = marshal.dumps(message, WITHOUT_REFERENCES)  # type: ignore[arg-type]  # made of texts, numbers and the like
        whole = len(data).to_bytes(HEADER, "big") + data
        for start in range(0, len(whole), PIECE):
            if start and (said := self.receive()) != MORE:
                if said is None:
                    return
                raise ProtocolError("it speaks in the middle of a message")
            self._send_piece(memoryview(whole)[start : start + PIECE])

    def _send_piece(self, rest: memoryview) -> None:
        stuck: Stuck | None = None
        while rest:
            began = time.monotonic()
            try:
                rest = rest[self._channel.send(rest) :]
            except BlockingIOError:  # nothing for so long
                stuck = stuck or Stuck(self.pid)
                stuck.check()
            except OSError:
                return
            self._be_patient(began)

    def receive(self) -> object:
        """The child's next message, which is JSON; None when it has hung up.

        Raises:
            ProtocolError: it is none.
            TimeoutError: the child waits for something that will never come.
        """
        frame = self.receive_bytes(MAX_FRAME)
        return None if frame is None else _parsed(frame)

    def receive_bytes(self, most: int) -> bytes | None:
        """The child's next frame; None when it has hung up.

        Args:
            most: how long it may be, in bytes.

        Raises:
            ProtocolError: it is longer.
            TimeoutError: the child waits for something that will never come.
        """
        stuck: Stuck | None = None
        while True:
            if len(self._buffer) >= HEADER:
                end = HEADER + int.from_bytes(self._buffer[:HEADER], "big")
                if end - HEADER > most:
                    raise ProtocolError("a frame is too long")
                if len(self._buffer) >= end:
                    frame = bytes(self._buffer[HEADER:end])
                    del self._buffer[:end]
                    return frame
            began = time.monotonic()
            try:
                piece = self._channel.recv(1 << 16)
            except BlockingIOError:  # nothing for so long
                stuck = stuck or Stuck(self.pid)
                stuck.check()
            except OSError:
                return None
            else:
                if not piece:
                    return None
                self._buffer += piece
            self._be_patient(began)

    def _be_patient(self, since: float) -> None:
        self.patience -= min(time.monotonic() - since, SILENCE)  # the rest is this process's own delay
        if self.patience < 0:
            raise TimeoutError

    def kill(self) -> None:
        """End it, if it has not ended."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def leave(self) -> None:
        """End it, if it has not ended, and do not wait for that."""
        self.kill()
        self.hang_up()

    def end(self) -> int:
        """End it, if it has not ended, and return its exit status, or minus the signal."""
        self.kill()
        try:
            return self._wait()
        finally:
            self.hang_up()

    def hang_up(self) -> None:
        """Say no more and hear no more."""
        self._channel.close()

    def rest(self) -> None:
        """Wait anew: what it was asked has been answered."""
        self.patience = LONGEST

    def was_closed(self) -> bool:
        """Whether its walls were closed, as far as can be seen; also told of the dead, until the next run."""
        if not self._closes:
            return True
        try:
            status = Path(f"/proc/{self.pid}/status").read_text(encoding="ascii", errors="replace")
        except OSError:
            return False
        return any(f"\nSeccomp:\t{mode}\n" in status for mode in (FILTERED, KILLED_BY_FILTER))

    def ended(self) -> int:
        """Wait a moment for it to end by itself; then like `end`."""
        for _ in range(50):
            if _state(self.pid) in (None, "Z"):
                break
            threading.Event().wait(0.002)
        return self.end()


def cause_of_death(status: int, seconds: int = CPU_SECONDS) -> tuple[Status, RunError]:
    """What a process died of that did not say how it ended.

    Args:
        status: its exit status, or minus the signal.
        seconds: of processor time that it was given.
    """
    match -status:
        case signal.SIGXCPU:
            return Status.TIMEOUT, RunError("TimeoutError", f"{seconds:,} {PROCESSOR_TIME}")
        case signal.SIGSYS:
            return Status.KILLED, RunError(
                "ForbiddenCall", "the program asked the kernel for what is forbidden"
            )
        case signal.SIGKILL:
            return Status.KILLED, RunError("MemoryError", "the process was killed from outside")
    how = f"signal {-status}" if status < 0 else f"exit status {status}"
    return Status.KILLED, RunError("Crash", f"the process ended by itself ({how})")


def _parsed(frame: bytes) -> object:
    try:
        message, end = parse(str(frame, "ascii"))
    except (ValueError, RecursionError):
        message, end = None, 0
    if message is None or end < len(frame):
        raise ProtocolError("a frame says nothing")
    return message


parse: Callable[[str], tuple[object, int]] = json.JSONDecoder().raw_decode
"""A child puts no spaces around what it says, and so need not be asked for them as `json.loads` does."""


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
