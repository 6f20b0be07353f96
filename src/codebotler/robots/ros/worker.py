"""CodeBotler's handle on a worker process under the robot's Python; they exchange lines of JSON."""

from __future__ import annotations

import json
import os
import queue
import select
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, TypeAlias, cast

from codebotler.core.terminal import note
from codebotler.robots.base import NotReadyError
from codebotler.robots.ros.motion import Motion

Message: TypeAlias = dict[str, Any]

FROM_WHEELS = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"  # set where ROS from wheels has started Python once more
WORKERS = Path(__file__).with_name("workers")
READY = 30.0  # seconds within which it must report that it is ready
BUILDS = 600.0  # seconds for that, if it says what it does meanwhile
LEAVES = 4.0  # seconds that it may take to end by itself
BEAT = 0.1  # seconds between two signs of life of this process, without which it stops the robot
MOTIONS = ("pose", "velocity")
LAST_LINES = 5  # of its error output, kept for error messages


class RosWorker:
    """A process that runs one of our scripts; when it has ended, `{"is": "ended"}` is received.

    It has a session of its own, so that Ctrl-C does not reach it before the robot was told to stop. It
    cancels the goal if this process gives no sign of life: a process that is suspended, or in which a long
    call lets no other thread run, hears neither Ctrl-C nor a request to stop.

    Args:
        python: the interpreter.
        script: a file of `workers/`, or a path.
        start: the first message it receives.
        environment: variables beyond those of this process.

    Raises:
        NotReadyError: it cannot be started, or reports that it cannot work.
    """

    def __init__(self, python: Path, script: str, start: Message, environment: Mapping[str, str]) -> None:
        self._messages: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self.motion = Motion()
        self._printed: deque[str] = deque(maxlen=LAST_LINES)
        self._writing = threading.Lock()
        self._cancel_sent, self._leaves = threading.Event(), threading.Event()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own file, by the interpreter that the user names
                [executable(python), str(WORKERS / script)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                env={**outer_environment(), **environment, "PYTHONUNBUFFERED": "1"},
                start_new_session=True,
            )
        except OSError as error:
            raise NotReadyError(
                f"{python}: {error.strerror}; name the robot's Python with --ros-python"
            ) from None
        pipes = (self._process.stdin, self._process.stdout, self._process.stderr)
        self._stdin, self._stdout, self._stderr = cast("tuple[IO[str], IO[str], IO[str]]", pipes)
        jobs = (self._listen, self._keep, self._beat)
        self._threads = [threading.Thread(target=job, daemon=True) for job in jobs]
        for thread in self._threads:
            thread.start()
        self.send(start)
        self.about = self._ready(python)

    def send(self, message: Message) -> None:
        """Send a message; if the process has died, that is received."""
        with self._writing, suppress(OSError, ValueError):
            self._stdin.write(json.dumps(message) + "\n")
            self._stdin.flush()

    def receive(self, seconds: float) -> Message | None:
        """Its next message; None if none comes for so many seconds."""
        try:
            return self._messages.get(timeout=seconds)
        except queue.Empty:
            return None

    def cancel(self, seconds: float) -> bool:
        """Have it cancel what goes on; False if it did not pass that on within so many seconds."""
        self._cancel_sent.clear()
        self.send({"do": "cancel"})
        return self._cancel_sent.wait(seconds)

    def leave(self) -> bool:
        """End it by closing its input, or by force; False if it had to be killed, or failed."""
        self._leaves.set()
        with self._writing, suppress(OSError):
            self._stdin.close()
        try:
            self._process.wait(LEAVES)
        except subprocess.TimeoutExpired:
            self.kill()
            return False
        self._close()
        return self._process.returncode == 0

    def kill(self) -> None:
        """End it and all its children at once."""
        self._leaves.set()
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._close()

    def how_it_ended(self) -> str:
        """Its exit status or signal, and the last line it printed."""
        self._process.wait(LEAVES)
        status = self._process.returncode
        how = f"signal {-status}" if status < 0 else f"status {status}"
        return f"{how}: {self._printed[-1]}" if self._printed else how

    def _ready(self, python: Path) -> Message:
        until = time.monotonic() + READY
        while (message := self.receive(max(0.0, until - time.monotonic()))) is not None:
            match message:
                case {"is": "ready"}:
                    return message
                case {"is": "progress", "text": str(text)}:
                    note(text)
                    until = time.monotonic() + BUILDS
                case {"is": "not-ready", "text": str(text)}:
                    self.leave()
                    raise NotReadyError(text)
                case {"is": "ended"}:
                    self.kill()
                    raise NotReadyError(f"the worker of {python} ended at once ({self.how_it_ended()})")
        self.kill()
        raise NotReadyError(f"the worker of {python} was not ready within {READY:g} s")

    def _listen(self) -> None:
        for line in self._stdout:
            try:
                message = json.loads(line)
            except ValueError:
                self._printed.append(line.strip())
                continue
            if message["is"] == "cancel-sent":
                self._cancel_sent.set()
                continue
            if message["is"] in MOTIONS:
                self.motion.take(message)
            if message["is"] not in {"alive", *MOTIONS} or self._messages.empty():  # one sign is enough
                self._messages.put(message)
        self._messages.put({"is": "ended"})

    def _beat(self) -> None:
        while not self._leaves.wait(BEAT):
            with suppress(OSError, ValueError):  # a worker that hangs must not make this thread hang as well
                if select.select([], [self._stdin], [], 0)[1]:
                    self.send({"do": "alive"})

    def _keep(self) -> None:
        self._printed.extend(line.strip() for line in self._stderr if line.strip())

    def _close(self) -> None:
        for thread in self._threads:
            thread.join(LEAVES)
        for pipe in (self._stdin, self._stdout, self._stderr):
            with suppress(OSError):  # of what was not yet written
                pipe.close()


def executable(python: Path) -> str:
    """An interpreter as a command; a name without a folder is looked for here first, then in PATH."""
    return str(python.absolute() if python.exists() else python)


def outer_environment() -> dict[str, str]:
    """The environment without what ROS from wheels has set for this interpreter alone."""
    environment = dict(os.environ)
    if environment.pop(FROM_WHEELS, None) is not None:
        folders = environment.get("LD_LIBRARY_PATH", "").split(os.pathsep)
        others = [folder for folder in folders if folder and not Path(folder).is_relative_to(sys.prefix)]
        environment["LD_LIBRARY_PATH"] = os.pathsep.join(others)
    return environment


def lacks(python: Path, modules: Sequence[str]) -> list[str] | None:
    """Which modules an interpreter lacks; None if it cannot be run. Nothing is imported."""
    code = "import sys, importlib.util as u; print(*(m for m in sys.argv[1:] if u.find_spec(m) is None))"
    try:
        done = subprocess.run(  # noqa: S603 - the interpreter that the user names
            [executable(python), "-c", code, *modules],
            capture_output=True,
            text=True,
            timeout=READY,
            check=True,
            env=outer_environment(),
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.split()
