"""Start and control a worker process under the robot's Python, exchanging lines of JSON with it."""

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

WorkerMessage: TypeAlias = dict[str, Any]

WHEELS_MARK = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"  # a variable that ROS from wheels sets when it restarts Python
WORKERS_FOLDER = Path(__file__).with_name("workers")
READY_SECONDS = 30.0  # the time limit for a worker to become ready
BUILD_SECONDS = 600.0  # the time limit after a progress report, such as about building messages
EXIT_SECONDS = 4.0  # the time limit for a worker to exit by itself before it is killed
HEARTBEAT_SECONDS = 0.1  # the heartbeat interval; without heartbeats, the worker stops the robot
MOTION_MESSAGES = ("pose", "velocity")
ERROR_LINES = 5  # the number of lines of error output to keep for error messages


class RosWorker:
    """A process that runs a script of `workers/` to talk to ROS. Its last message is `{"is": "ended"}`.

    It runs in its own session so that Ctrl-C does not end it before it has stopped the robot. If heartbeats
    from this process stop, the worker cancels the goal, since a suspended process cannot react to Ctrl-C.
    `about` is the worker's message that it is ready, and `motion` tracks the robot's motion.

    Args:
        python: the Python interpreter that runs the script.
        script: the name of a file in `workers/`, or a path.
        start: the first message to the worker.
        environment: additional environment variables.

    Raises:
        NotReadyError: the worker does not start, or reports that it cannot work.
    """

    def __init__(
        self, python: Path, script: str, start: WorkerMessage, environment: Mapping[str, str]
    ) -> None:
        self._messages: queue.SimpleQueue[WorkerMessage] = queue.SimpleQueue()
        self.motion = Motion()
        self._printed: deque[str] = deque(maxlen=ERROR_LINES)
        self._writing = threading.Lock()
        self._cancel_sent, self._leaves = threading.Event(), threading.Event()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own script, run by the interpreter that the user names
                [executable(python), str(WORKERS_FOLDER / script)],
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
            why = f"{python} does not start: {error.strerror}"
            raise NotReadyError(f"{why}; name the robot's Python with --ros-python") from None
        pipes = (self._process.stdin, self._process.stdout, self._process.stderr)
        self._stdin, self._stdout, self._stderr = cast("tuple[IO[str], IO[str], IO[str]]", pipes)
        jobs = (self._listen, self._keep_errors, self._send_heartbeats)
        self._threads = [threading.Thread(target=job, daemon=True) for job in jobs]
        for thread in self._threads:
            thread.start()
        self.send(start)
        self.about = self._wait_until_ready(python)

    def send(self, message: WorkerMessage) -> None:
        """Send a message. If the worker has died, a later `receive` reports this."""
        with self._writing, suppress(OSError, ValueError):
            self._stdin.write(json.dumps(message) + "\n")
            self._stdin.flush()

    def receive(self, seconds: float) -> WorkerMessage | None:
        """Return the next message, or None if no message arrives within `seconds`."""
        try:
            return self._messages.get(timeout=seconds)
        except queue.Empty:
            return None

    def cancel(self, seconds: float) -> bool:
        """Tell the worker to cancel the goal. Return whether it sent the cancel request within `seconds`."""
        self._cancel_sent.clear()
        self.send({"do": "cancel"})
        return self._cancel_sent.wait(seconds)

    def leave(self) -> bool:
        """End the worker by closing its input. Return False if the worker failed or had to be killed."""
        self._leaves.set()
        with self._writing, suppress(OSError):
            self._stdin.close()
        try:
            self._process.wait(EXIT_SECONDS)
        except subprocess.TimeoutExpired:
            self.kill()
            return False
        self._close()
        return self._process.returncode == 0

    def kill(self) -> None:
        """Kill the worker and all its child processes."""
        self._leaves.set()
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        self._close()

    def describe_end(self) -> str:
        """Return how the worker ended, such as `status 1`, with the last line of its error output, if any."""
        self._process.wait(EXIT_SECONDS)
        status = self._process.returncode
        how = f"signal {-status}" if status < 0 else f"status {status}"
        return f"{how}: {self._printed[-1]}" if self._printed else how

    def _wait_until_ready(self, python: Path) -> WorkerMessage:
        deadline = time.monotonic() + READY_SECONDS
        while (message := self.receive(max(0.0, deadline - time.monotonic()))) is not None:
            match message:
                case {"is": "ready"}:
                    return message
                case {"is": "progress", "text": str(text)}:
                    note(text)
                    deadline = time.monotonic() + BUILD_SECONDS
                case {"is": "not-ready", "text": str(text)}:
                    self.leave()
                    raise NotReadyError(text)
                case {"is": "ended"}:
                    self.kill()
                    raise NotReadyError(f"the ROS worker of {python} ended at once ({self.describe_end()})")
        self.kill()
        raise NotReadyError(f"the ROS worker of {python} was not ready within {READY_SECONDS:g} s")

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
            if message["is"] in MOTION_MESSAGES:
                self.motion.record(message)
            is_repeated = message["is"] in {"alive", *MOTION_MESSAGES}  # one of these in the queue is enough
            if not is_repeated or self._messages.empty():
                self._messages.put(message)
        self._messages.put({"is": "ended"})

    def _send_heartbeats(self) -> None:
        while not self._leaves.wait(HEARTBEAT_SECONDS):
            with suppress(OSError, ValueError):
                if select.select([], [self._stdin], [], 0)[1]:  # else a hanging worker would block us
                    self.send({"do": "alive"})

    def _keep_errors(self) -> None:
        self._printed.extend(line.strip() for line in self._stderr if line.strip())

    def _close(self) -> None:
        for thread in self._threads:
            thread.join(EXIT_SECONDS)
        for pipe in (self._stdin, self._stdout, self._stderr):
            with suppress(OSError):  # closing flushes the pipe, which can fail
                pipe.close()


def executable(python: Path) -> str:
    """Return the command for an interpreter. A bare name is looked up in the current folder, then in PATH."""
    return str(python.absolute() if python.exists() else python)


def outer_environment() -> dict[str, str]:
    """Return the environment variables without the changes made by a ROS that pip installed."""
    environment = dict(os.environ)
    if environment.pop(WHEELS_MARK, None) is not None:
        folders = environment.get("LD_LIBRARY_PATH", "").split(os.pathsep)
        others = [folder for folder in folders if folder and not Path(folder).is_relative_to(sys.prefix)]
        environment["LD_LIBRARY_PATH"] = os.pathsep.join(others)
    return environment


def find_missing(python: Path, modules: Sequence[str]) -> list[str] | None:
    """Return the modules that an interpreter lacks, or None if the interpreter cannot be run."""
    code = "import sys, importlib.util as u; print(*(m for m in sys.argv[1:] if u.find_spec(m) is None))"
    try:
        done = subprocess.run(  # noqa: S603 - the interpreter that the user names
            [executable(python), "-c", code, *modules],
            capture_output=True,
            text=True,
            timeout=READY_SECONDS,
            check=True,
            env=outer_environment(),
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.split()
