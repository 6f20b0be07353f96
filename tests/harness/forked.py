"""Commands in processes of their own, forked from one that has imported what they need."""

from __future__ import annotations

import atexit
import importlib
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:  # the Python of a robot on ROS, which forks nodes, may be an old one
    from types import TracebackType
    from typing import Self

PAGE = (
    *("codebotler.cli.operating.serving", "codebotler.robots.open", "codebotler.web.server"),
    *("fastapi.middleware.gzip", "nicegui.middlewares", "nicegui.ui_run_with", "roboeval.web.pages"),
    *("uvicorn.lifespan.on", "uvicorn.loops.uvloop", "uvicorn.protocols.websockets.auto"),
)
"""What a page needs besides, and other commands do not."""
PROGRAMS = (
    *("codebotler.cli.operating.run", "codebotler.cli.programs.check", "codebotler.cli.programs.generate"),
    *("codebotler.cli.programs.rules", "codebotler.generation.generate", "codebotler.missions.session"),
    *("codebotler.robots.open", "codebotler.robots.simulated", "roboeval.analysis.resample"),
    *("roboeval.cli.views.completions", "roboeval.cli.views.results", "roboeval.cli.views.tasks"),
    *("roboeval.evaluation.evaluate", "roboeval.evaluation.generating.generate"),
    *("asyncio", "polars", "rich.live", "rich.syntax", "rich.table"),
)
"""What most other commands need."""
LONGEST = 1_000_000  # bytes of a request


class Forked:
    """A command in a process of its own, as `python -m NAME ARGUMENTS` would be; pipes are its streams.

    Args:
        name: `codebotler` or `roboeval`; or `-c`, as with `python -c`.
        arguments: those of the command; with `-c`, the text of a script and its arguments.
        cwd: the folder in which it is called.
        environment: all its variables.
        stderr: a file for what it says beside them; a pipe by default.
        preload: modules that are imported before it is forked, once for all.
        server: the process from which it is forked; one for all by default.
        own_session: whether it leads a session of its own.
    """

    def __init__(
        self,
        name: str,
        *arguments: str | Path,
        cwd: Path,
        environment: Mapping[str, str],
        stderr: IO[str] | None = None,
        preload: Sequence[str] = PROGRAMS,
        server: Server | None = None,
        own_session: bool = False,
    ) -> None:
        self._server = server or SERVER
        theirs, given = os.pipe()
        told, to_out = os.pipe()
        said, to_err = os.pipe() if stderr is None else (None, os.dup(stderr.fileno()))
        self.stdin = os.fdopen(given, "w", encoding="utf-8")
        self.stdout: IO[str] | None = os.fdopen(told, encoding="utf-8")
        self.stderr = None if said is None else os.fdopen(said, encoding="utf-8")
        job = {"words": [name, *map(str, arguments)], "cwd": str(cwd), "env": dict(environment)}
        handed = (theirs, to_out, to_err)
        more = {"preload": list(preload), "own_session": own_session}
        self.pid: int = self._server.ask({**job, **more}, handed)
        self.returncode: int | None = None
        for end in handed:
            os.close(end)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.communicate()

    def poll(self) -> int | None:
        """Its status, once it has ended; minus the number of the signal that has ended it."""
        if self.returncode is None:
            self.returncode = self._server.ask({"ended": self.pid})
        return self.returncode

    def wait(self, timeout: float = 600) -> int:
        """Its status, when it has ended.

        Raises:
            TimeoutError: it has not, after so many seconds.
        """
        ends = time.monotonic() + timeout
        while (status := self.poll()) is None:
            if time.monotonic() > ends:
                raise TimeoutError
            time.sleep(0.005)
        return status

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def communicate(self, given: str = "", timeout: float = 600) -> tuple[str, str]:
        """Give it its input, and wait until it has ended, reading the rest of what it prints and says."""
        with ThreadPoolExecutor(2) as pool:
            streams = [None if one is None or one.closed else one for one in (self.stdout, self.stderr)]
            texts = [pool.submit(one.read) if one else None for one in streams]
            with suppress(BrokenPipeError, ValueError), self.stdin:  # it may have gone, or been asked before
                self.stdin.write(given)
            try:
                self.wait(timeout)
            except TimeoutError:
                self.kill()
                raise
            out, err = ("" if text is None else text.result() for text in texts)
        for stream in streams:
            if stream:
                stream.close()
        return out, err


class Server:
    """The process from which commands are forked; started when the first is.

    Args:
        missing: packages that cannot be imported there, as if they were not installed.
        command: what starts it, without the descriptor that follows.
    """

    def __init__(
        self, missing: Sequence[str] = (), command: Sequence[str] = (sys.executable, __file__)
    ) -> None:
        self._missing = list(missing)
        self._command = list(command)
        self._lock = threading.Lock()
        self._line: socket.socket | None = None
        self._process: subprocess.Popen[bytes] | None = None

    def ask(self, request: Mapping[str, Any], descriptors: Sequence[int] = ()) -> Any:  # noqa: ANN401 - JSON has no types
        """Send it a request, with descriptors for a command's streams, and return its answer."""
        with self._lock:
            line = self._line or self._start()
            socket.send_fds(line, [json.dumps(request).encode()], list(descriptors))
            return json.loads(line.recv(LONGEST))

    def end(self) -> None:
        """End it, when this process ends."""
        if self._line is not None and self._process is not None:
            self._line.close()
            self._process.wait()

    def _start(self) -> socket.socket:
        self._line, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            for end in (self._line, theirs):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, LONGEST)
            command = [*self._command, str(theirs.fileno()), *self._missing]
            self._process = subprocess.Popen(command, pass_fds=[theirs.fileno()])
        atexit.register(self.end)
        return self._line


SERVER = Server()


# --- in the process that forks


def serve(line: socket.socket) -> list[str] | None:
    """Fork a process for each command; in that, return the command's words."""
    ended: dict[int, int] = {}
    while True:
        data, descriptors, *_ = socket.recv_fds(line, LONGEST, 3)
        if not data:
            return None
        request = json.loads(data)
        if "ended" in request:
            line.send(json.dumps(status_of(request["ended"], ended)).encode())
            continue
        for name in request["preload"]:
            importlib.import_module(name)
        pid = os.fork()
        if pid == 0:
            line.close()
            become(request, descriptors)
            return list(request["words"])
        ended.pop(pid, None)  # numbers of processes come round again in a long run of tests
        for number in descriptors:
            os.close(number)
        line.send(json.dumps(pid).encode())


def status_of(pid: int, ended: dict[int, int]) -> int | None:
    """With which status a process has ended; None while it has not."""
    if pid not in ended:
        found, status = os.waitpid(pid, os.WNOHANG)
        if not found:
            return None
        ended[pid] = os.waitstatus_to_exitcode(status)
    return ended[pid]


def become(request: Mapping[str, Any], descriptors: Sequence[int]) -> None:
    """Be what a shell would have started: its streams, its folder, its variables, and its signals."""
    for standard, number in enumerate(descriptors):
        os.dup2(number, standard)
        os.close(number)
    if request.get("own_session"):
        os.setsid()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # also where the tests were begun with nohup
    os.chdir(request["cwd"])
    os.environ.clear()
    os.environ.update(request["env"])
    sys.stdin = os.fdopen(0, encoding="utf-8")
    sys.stdout = os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", errors="backslashreplace", buffering=1)
    sys.argv = list(request["words"])
    first = str(Path(sys.argv[0]).parent) if sys.argv[0].endswith(".py") else request["cwd"]
    more = (first, *request["env"].get("PYTHONPATH", "").split(os.pathsep))
    sys.path[:0] = [folder for folder in more if folder and folder not in sys.path]


def run_script() -> None:
    """Run what `python -c` would."""
    exec(sys.argv.pop(1), {"__name__": "__main__"})


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.modules.update(dict.fromkeys(sys.argv[2:]))  # type: ignore[arg-type]  # None: cannot be imported
    mains = {name: importlib.import_module(f"{name}.__main__").main for name in ("codebotler", "roboeval")}
    mains["-c"] = run_script
    with socket.socket(fileno=int(sys.argv[1])) as door:
        words = serve(door)
    if words is not None:
        mains[words[0]]()
