"""The engine's handle on an isolated process: starts it, exchanges messages, learns how it ended."""

from __future__ import annotations

import atexit
import contextlib
import importlib
import inspect
import json
import marshal
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import IO

from codebotler.core.cachedproperty import cached_property
from codebotler.core.trace import RunError, Status
from codebotler.simulator.sandbox import (
    BATCH_SERVER,
    CPU_SECONDS,
    FLAGS,
    FORK_SERVER,
    HEADER,
    LIVE_SERVER,
    MAX_FRAME,
    MORE,
    PIECE,
    PREPARER,
    WITHOUT_REFERENCES,
)
from codebotler.simulator.sandbox.stdlib import IMPORTED

PROCESSOR_TIME = "seconds of processor time"  # how the message of a program ends that computed for too long
LONGEST = 60.0  # seconds of waiting for a process in all; nothing that computes takes so long
SILENCE = 1  # seconds after which a silent process is looked at
SECCOMP_MODES = "\nSeccomp:\t2\n", "\nSeccomp:\t3\n"  # filtered, and killed by the filter
SANDBOX = Path(__file__).with_name("sandbox")
SKILLS = SANDBOX.parents[1] / "core" / "skills"
CORE, BATCHES = "codebotler.core", f"{__package__}.batches"
# What a child needs that has robots of its own, besides the sandbox.
SIMULATION = (
    f"{BATCHES}.process",
    *(
        f"{CORE}.{name}"
        for name in ("cachedproperty", "errors", "regex_flags", "trace", "unicode", "words", "world")
    ),
    *(f"{CORE}.skills.{path.stem}" for path in sorted(SKILLS.glob("[a-z]*.py")) if path.stem != "files"),
    *(f"{__package__}.{name}" for name in ("fact_sampler", "ledger", "robot", "rules", "sampled_robot")),
)
MODULES = {PREPARER: f"{__package__}.sandbox.preparer", BATCH_SERVER: f"{BATCHES}.process"}


# --- starting


def start(role: str, *descriptors: int) -> subprocess.Popen[bytes]:
    """Start a process in one of the roles, and hand it descriptors."""
    handed = (compiled_file(role).fileno(), *descriptors)
    module = MODULES.get(role, f"{__package__}.sandbox.fork_server")
    with ONE_AT_A_TIME:
        return subprocess.Popen(  # noqa: S603 - our own file, by the interpreter that runs us
            [sys.executable, *FLAGS, str(SANDBOX / "start.py"), module, role, *map(str, handed)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env={
                "PYTHONHASHSEED": "0",
                "TZ": "UTC",
                "LC_ALL": "C.UTF-8",
                "PYTHONUTF8": "1",
                "LD_BIND_NOW": "1",
            },
            pass_fds=handed,
            start_new_session=True,
        )


ONE_AT_A_TIME = threading.Lock()
# Who forks this process in the middle of a start would get half of it: a lock that nobody opens, and the end
# of a pipe on whose closing the start waits.
os.register_at_fork(
    before=ONE_AT_A_TIME.acquire,
    after_in_parent=ONE_AT_A_TIME.release,
    after_in_child=ONE_AT_A_TIME.release,
)


def compiled_file(role: str) -> IO[bytes]:
    """A file with the code of the modules that a process in one of the roles runs."""
    with ONE_AT_A_TIME:
        return _written_file(FORK_SERVER if role == LIVE_SERVER else role)


@cache
def _written_file(role: str) -> IO[bytes]:
    codes = compiled_modules(compiled, role)
    file: IO[bytes] = (  # closed at the end of this process; in memory if possible, since a disk may be full
        os.fdopen(os.memfd_create("codes"), "w+b") if sys.platform == "linux" else tempfile.TemporaryFile()  # noqa: SIM115 - see above
    )
    atexit.register(file.close)
    try:
        file.write(codes)
        file.flush()
    except OSError as error:  # a limit on the size of files holds in memory, too
        raise LostProcessError(f"{error.strerror}; allow larger files with `ulimit -f unlimited`") from None
    return file


def compiled_modules(compiler: Callable[[str, str], bytes], role: str) -> bytes:
    """The code of all modules that a process in one of the roles runs, by name, as one message."""
    further = SIMULATION if role == BATCH_SERVER else ()
    simulator, package = __package__, __package__ + ".sandbox"
    files = {package: str(SANDBOX / "__init__.py")}
    files |= {f"{package}.{path.stem}": str(path) for path in sorted(SANDBOX.glob("[a-z]*.py"))}
    files |= {name: inspect.getfile(importlib.import_module(name)) for name in ("__future__", "types")}
    folder = SANDBOX.parents[1]
    files |= {name: str(folder.joinpath(*name.split(".")[1:]).with_suffix(".py")) for name in further}
    empty = [simulator.partition(".")[0], simulator, *([CORE, f"{CORE}.skills", BATCHES] if further else ())]
    codes = {name: compiled_source("", f"<{name}>") for name in empty}
    codes |= {name: compiler(file, f"<{name}>") for name, file in files.items()}
    if role not in {PREPARER, BATCH_SERVER}:
        codes |= {name: code_of(str(file), file.name) for name, file in stdlib_files().items()}
    return marshal.dumps(codes, WITHOUT_REFERENCES)


def stdlib_files() -> dict[str, Path]:
    """Nearly all modules of the standard library that programs can import, or that these are made of."""
    folder, files = Path(os.__file__).parent, {}
    for name in IMPORTED:
        path = folder.joinpath(*name.split("."))
        if path.with_suffix(".py").is_file():
            files[name] = path.with_suffix(".py")
        elif (path / "__init__.py").is_file():
            files[name] = path / "__init__.py"
            parts = (part for part in sorted(path.glob("*.py")) if part.stem != "__init__")
            files |= {f"{name}.{part.stem}": part for part in parts}
    return files


def code_of(file: str, shown: str) -> bytes:
    """The code of one module, the same however this interpreter was started; `shown` is in tracebacks."""
    code = None
    if not sys.flags.optimize:
        with contextlib.suppress(EOFError, ImportError, ValueError):  # bytecode that is damaged
            code = SourceFileLoader(shown, file).get_code(shown)
    if code is None or all(column is None for _, _, column, _ in code.co_positions()):
        # It was written by an interpreter that leaves columns out, so that it is shorter.
        return compiled_source(Path(file).read_text(encoding="utf-8"), shown)
    return dumped(code, shown)


compiled = cache(code_of)


def compiled_source(source: str, shown: str) -> bytes:
    """The same of a module that is in no file, or in another form there."""
    return dumped(compile(source, "", "exec", dont_inherit=True, optimize=0), shown)


def dumped(code: CodeType, shown: str) -> bytes:
    """Code that names no path, whose length would move what comes after it in memory."""

    def nameless(code: CodeType) -> CodeType:
        parts = (nameless(part) if isinstance(part, CodeType) else part for part in code.co_consts)
        return code.replace(co_filename=shown, co_consts=tuple(parts))

    return marshal.dumps(nameless(code), WITHOUT_REFERENCES)


# --- talking


class IsolatedProcess:
    """One isolated process, seen from outside."""

    def __init__(
        self,
        find_pid: Callable[[], int],  # which stays its own until the next run
        channel: socket.socket,
        wait: Callable[[], int],  # for its end; returns the exit status, or minus the signal
        *,
        has_seccomp: bool,  # so that it can be seen from outside whether it is isolated by now
    ) -> None:
        self._find_pid, self._channel, self._wait = find_pid, channel, wait
        silence = struct.pack("ll", SILENCE, 0)
        for direction in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):  # one system call less than settimeout
            channel.setsockopt(socket.SOL_SOCKET, direction, silence)
        self._has_seccomp = has_seccomp
        self._buffer = bytearray()
        self.patience = LONGEST  # seconds for which it will still be waited for

    @cached_property
    def pid(self) -> int:
        """Its process id; a process without one is lost."""
        try:
            return self._find_pid()
        except LostProcessError:
            self.hang_up()
            raise

    def send(self, message: object, *, at_once: bool = False) -> None:
        """Send a message; that the process is gone is noticed when it is listened to.

        Where a program could see the heap, which what it reads leaves its mark on, a message goes in pieces:
        each but the last is asked for more. So their sizes depend on the message only, and not on how quick
        the process was.
        """
        data = marshal.dumps(message, WITHOUT_REFERENCES)  # type: ignore[arg-type]  # made of texts, numbers and the like
        whole = len(data).to_bytes(HEADER, "big") + data
        size = len(whole) if at_once else PIECE
        for start in range(0, len(whole), size):
            if start and (reply := self.receive()) != MORE:
                if reply is None:
                    return
                raise ProtocolError("it speaks in the middle of a message")
            self._send_piece(memoryview(whole)[start : start + size])

    def _send_piece(self, rest: memoryview) -> None:
        watch = StuckDetector(self)
        while rest:
            began = time.monotonic()
            try:
                rest = rest[self._channel.send(rest) :]
            except BlockingIOError:  # nothing for so long
                watch.check()
            except OSError:
                return
            self._be_patient(began)

    def receive(self) -> object:
        """Its next message, which is JSON; None when it has hung up.

        Raises ProtocolError if it is none, and TimeoutError if the process waits for what will never come.
        """
        frame = self.receive_bytes(MAX_FRAME)
        if frame is None:
            return None
        try:
            message, end = decode(str(frame, "ascii"))
        except (ValueError, RecursionError):
            message, end = None, 0
        if message is None or end < len(frame):
            raise ProtocolError("a frame says nothing")
        return message

    def receive_bytes(self, most: int) -> bytes | None:
        """Its next frame, which may have so many bytes; None when it has hung up."""
        watch = StuckDetector(self)
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
                watch.check()
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
        """End it, if it has not ended, and do not wait for that."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def end(self) -> int:
        """End it, if it has not ended, and return its exit status, or minus the signal."""
        self.kill()
        try:
            return self._wait()
        finally:
            self.hang_up()

    def ended(self) -> int:
        """Wait a moment for it to end by itself; then like `end`."""
        for _ in range(50):
            if _stat(self.pid)[:1] in ([], ["Z"]):
                break
            time.sleep(0.002)
        return self.end()

    def reset_patience(self) -> None:
        """Wait anew, since it has answered."""
        self.patience = LONGEST

    def hang_up(self) -> None:
        """Close the channel."""
        self._channel.close()

    def was_isolated(self) -> bool:
        """Whether its filter was installed, as far as can be seen; of a dead process until the next run."""
        if not self._has_seccomp:
            return True
        try:
            status = Path(f"/proc/{self.pid}/status").read_text(encoding="ascii", errors="replace")
        except OSError:
            return False
        return any(mode in status for mode in SECCOMP_MODES)


class StuckDetector:
    """Distinguishes a process that waits for nothing from one that computes.

    A process that sleeps at two checks, and used no processor time between them, is stuck.
    """

    def __init__(self, process: IsolatedProcess) -> None:
        self._process = process
        self._used: int | None = None

    def check(self) -> None:
        """Raise TimeoutError if the process is stuck."""
        fields = _stat(self._process.pid)
        used = int(fields[11]) + int(fields[12]) if fields[:1] == ["S"] else None
        if used is not None and used == self._used:
            raise TimeoutError
        self._used = used


def _stat(pid: int) -> list[str]:
    """What the kernel shows of a process, from its state on; nothing once it is gone."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return []
    return stat.rpartition(")")[2].split()


# A process puts no spaces around what it says, and so need not be asked for them as `json.loads` does.
decode: Callable[[str], tuple[object, int]] = json.JSONDecoder().raw_decode


# --- ending


def cause_of_death(status: int, seconds: int = CPU_SECONDS) -> tuple[Status, RunError]:
    """What a process died of without a last message, by its exit status or minus the signal."""
    match -status:
        case signal.SIGXCPU:
            return Status.TIMEOUT, RunError("TimeoutError", f"{seconds:,} {PROCESSOR_TIME}")
        case signal.SIGSYS:
            return Status.KILLED, RunError("ForbiddenCall", "the program made a forbidden system call")
        case signal.SIGKILL:
            return Status.KILLED, RunError("MemoryError", "the process was killed from outside")
    how = f"signal {-status}" if status < 0 else f"exit status {status}"
    return Status.KILLED, RunError("Crash", f"the process ended by itself ({how})")


class LostProcessError(Exception):
    """A process ended before it was isolated, through no fault of the program."""


class ProtocolError(Exception):
    """The program has got hold of the channel and sends what our own code never would."""
