"""A worker, seen from outside: a process of the robot's own Python that speaks lines of JSON."""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any, TypeAlias

from codebotler.robots.base import NotReadyError

Message: TypeAlias = dict[str, Any]

READY = 30.0  # seconds within which it must say whether it can work
LEAVES = 4.0  # seconds that it may take to end by itself
LAST_LINES = 5  # of what it printed, for the sentence about its end
ENDED = "ended"  # what is received when it has


class RosWorker:
    """A process that runs one of our scripts.

    It has a session of its own, so that Ctrl-C does not reach it before the robot was told to stop.

    Args:
        python: the interpreter.
        script: the file.
        start: the first line it is told.
        environment: what is set beyond our own environment.

    Raises:
        NotReadyError: it cannot be started, or says that it cannot work.
    """

    def __init__(self, python: Path, script: Path, start: Message, environment: Mapping[str, str]) -> None:
        self._messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._printed: deque[str] = deque(maxlen=LAST_LINES)
        self._writing = threading.Lock()
        self._cancel_sent = threading.Event()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own file, by the interpreter that the user names
                [str(python), str(script)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                env={**os.environ, **environment, "PYTHONUNBUFFERED": "1"},
                start_new_session=True,
            )
        except OSError as error:
            raise NotReadyError(
                f"{python}: {error.strerror}; name the robot's Python by --ros-python"
            ) from None
        self._readers = [
            threading.Thread(target=self._listen, args=(self._process.stdout,), daemon=True),
            threading.Thread(target=self._keep, args=(self._process.stderr,), daemon=True),
        ]
        for reader in self._readers:
            reader.start()
        self.send(start)
        self.about = self._ready(python)

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    def send(self, message: Message) -> None:
        """Tell it something; in vain if it has died, which is then received."""
        with self._writing:
            try:
                assert self._process.stdin is not None
                self._process.stdin.write(json.dumps(message) + "\n")
                self._process.stdin.flush()
            except (OSError, ValueError):
                pass

    def receive(self, seconds: float) -> Message | None:
        """What it says next; None if it says nothing for so long."""
        try:
            return self._messages.get(timeout=seconds)
        except queue.Empty:
            return None

    def cancel(self, seconds: float) -> bool:
        """Have it cancel what goes on, and tell whether it has passed that on within so many seconds."""
        self._cancel_sent.clear()
        self.send({"do": "cancel"})
        return self._cancel_sent.wait(seconds)

    def leave(self) -> bool:
        """End it, gently if it can, and tell whether it could."""
        with self._writing:
            try:
                assert self._process.stdin is not None
                self._process.stdin.close()
            except OSError:
                pass
        try:
            self._process.wait(LEAVES)
        except subprocess.TimeoutExpired:
            self.kill()
            return False
        self._close()
        return self._process.returncode == 0

    def kill(self) -> None:
        """End it at once, and whatever it has started."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._close()

    def epitaph(self) -> str:
        """How it ended, in a phrase."""
        self._process.wait(LEAVES)
        status = self._process.returncode
        how = f"signal {-status}" if status < 0 else f"status {status}"
        said = f": {self._printed[-1]}" if self._printed else ""
        return f"{how}{said}"

    def _ready(self, python: Path) -> Message:
        until = time.monotonic() + READY
        while (message := self.receive(max(0.0, until - time.monotonic()))) is not None:
            match message:
                case {"is": "ready"}:
                    return message
                case {"is": "not-ready", "text": str(text)}:
                    self.leave()
                    raise NotReadyError(text)
                case {"is": "ended"}:
                    for reader in self._readers:
                        reader.join(LEAVES)
                    self.kill()
                    raise NotReadyError(f"the worker of {python} ended at once ({self.epitaph()})")
        self.kill()
        raise NotReadyError(f"the worker of {python} was not ready within {READY:g} s")

    def _listen(self, lines: IO[str]) -> None:
        for line in lines:
            try:
                message = json.loads(line)
            except ValueError:
                self._printed.append(line.strip())
                continue
            if message["is"] == "cancel-sent":
                self._cancel_sent.set()
            elif message["is"] != "alive" or self._messages.empty():  # where nobody asks, one will do
                self._messages.put(message)
        self._messages.put({"is": ENDED})

    def _keep(self, lines: IO[str]) -> None:
        self._printed.extend(line.strip() for line in lines if line.strip())

    def _close(self) -> None:
        for reader in self._readers:
            if reader is not threading.current_thread():
                reader.join(LEAVES)
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            try:
                if pipe is not None:
                    pipe.close()
            except OSError:  # what was not yet written
                pass


def lacks(python: Path, modules: Sequence[str]) -> list[str] | None:
    """Which modules an interpreter lacks; None if it cannot be run. Nothing is imported."""
    code = "import sys, importlib.util as u; print(*(m for m in sys.argv[1:] if u.find_spec(m) is None))"
    try:
        done = subprocess.run(  # noqa: S603 - the interpreter that the user names
            [str(python), "-c", code, *modules], capture_output=True, text=True, timeout=READY, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.split()
