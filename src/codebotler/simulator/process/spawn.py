"""Starts isolated processes with our own code, by the interpreter that runs us."""

from __future__ import annotations

import _imp
import atexit
import contextlib
import importlib
import inspect
import marshal
import os
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from functools import cache
from importlib.machinery import SourceFileLoader
from io import FileIO
from pathlib import Path
from typing import IO
from weakref import WeakSet

from codebotler.simulator.process.errors import LostProcessError
from codebotler.simulator.sandbox import FLAGS, WITHOUT_REFERENCES
from codebotler.simulator.sandbox.stdlib import IMPORTED

SIMULATOR = __package__.rpartition(".")[0]
SANDBOX = Path(__file__).parents[1] / "sandbox"
CHILD_ENVIRONMENT = {
    "PYTHONHASHSEED": "0",
    "TZ": "UTC",
    "LC_ALL": "C.UTF-8",
    "PYTHONUTF8": "1",
    "LD_BIND_NOW": "1",
}


def start_fork_server(*descriptors: int) -> subprocess.Popen[bytes]:
    """Start a fork server with fixed memory addresses. It inherits these open file descriptors."""
    handed = (*descriptors, compiled_file().fileno())
    return _start([str(SANDBOX / "start.py"), *map(str, handed)], handed)


def start_module(code: str, arguments: Sequence[str], descriptors: Sequence[int]) -> subprocess.Popen[bytes]:
    """Start a process that runs `code`. Its `sys.argv` has the arguments, then the inherited descriptors."""
    folders = [os.path.abspath(folder) for folder in sys.path]  # noqa: PTH100 - Path.resolve follows links
    setup = f"import sys; sys.path[:] = {folders!r}; {code}"
    return _start(["-c", setup, *arguments, *map(str, descriptors)], descriptors)


def _start(arguments: Sequence[str], descriptors: Sequence[int]) -> subprocess.Popen[bytes]:
    with START_LOCK:
        process = subprocess.Popen(  # noqa: S603 - our own code, by the interpreter that runs us
            [sys.executable, *FLAGS, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env=CHILD_ENVIRONMENT,
            pass_fds=descriptors,
            start_new_session=True,
        )
        PROCESSES.add(process)
        return process


PROCESSES: WeakSet[subprocess.Popen[bytes]] = WeakSet()
CHANNELS: WeakSet[socket.socket | FileIO] = WeakSet()  # the engine's ends
START_LOCK = threading.Lock()
# A fork during a start would inherit a locked lock, and keep open a pipe that the start expects to close.
os.register_at_fork(before=START_LOCK.acquire, after_in_parent=START_LOCK.release)


def leave_to_parent() -> None:
    """In a forked child, forget all isolated processes, since only the parent can wait for them."""
    for process in PROCESSES:
        process.returncode = 0
    for channel in CHANNELS:
        channel.close()
    START_LOCK.release()


os.register_at_fork(after_in_child=leave_to_parent)


def compiled_file() -> IO[bytes]:
    """Return an open file with the compiled code of all modules of a fork server."""
    with START_LOCK:
        return _written_file()


@cache
def _written_file() -> IO[bytes]:
    codes = compiled_modules(code_of)
    file: IO[bytes] = (  # in memory if possible, since the disk may be full
        os.fdopen(os.memfd_create("codes"), "w+b") if sys.platform == "linux" else tempfile.TemporaryFile()  # noqa: SIM115 - see above
    )
    atexit.register(file.close)
    try:
        file.write(codes)
        file.flush()
    except OSError as error:  # the file size limit applies to files in memory as well
        hint = "allow larger files with `ulimit -f unlimited`"
        raise LostProcessError(f"the compiled sandbox cannot be stored ({error.strerror}); {hint}") from None
    return file


# --- the code of fork servers


def compiled_modules(compiler: Callable[[str, str], bytes]) -> bytes:
    """Compile all modules of a fork server to a marshalled dict by name. `compiler` is like `code_of`."""
    package = f"{SIMULATOR}.sandbox"
    files = {package: str(SANDBOX / "__init__.py")}
    files |= {f"{package}.{path.stem}": str(path) for path in sorted(SANDBOX.glob("[a-z]*.py"))}
    files |= {name: inspect.getfile(importlib.import_module(name)) for name in ("__future__", "types")}
    codes = {name: compiled_source("", f"<{name}>") for name in (SIMULATOR.partition(".")[0], SIMULATOR)}
    codes |= {name: compiler(file, f"<{name}>") for name, file in files.items()}
    codes |= {name: code_of(str(file), file.name) for name, file in stdlib_files().items()}
    return marshal.dumps(codes, WITHOUT_REFERENCES)


def stdlib_files() -> dict[str, Path]:
    """Return the names and files of the standard library modules that programs can import."""
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
    """Return a Python file's marshalled code, whatever our Python's options. Tracebacks show `shown`."""
    code = None
    if not sys.flags.optimize:
        with contextlib.suppress(EOFError, ImportError, ValueError):  # the bytecode file is damaged
            code = SourceFileLoader(shown, file).get_code(shown)
    if code is None or all(column is None for _, _, column, _ in code.co_positions()):
        # Compile again, since an interpreter that omits column numbers wrote this shorter code.
        return compiled_source(Path(file).read_text(encoding="utf-8"), shown)
    # As importlib does it. The length of a path would change memory addresses.
    _imp._fix_co_filename(code, shown)  # type: ignore[attr-defined]  # noqa: SLF001 - the only way in place
    return marshal.dumps(code, WITHOUT_REFERENCES)


def compiled_source(source: str, shown: str) -> bytes:
    """Compile a source text, and return its marshalled code. `shown` is the file name in tracebacks."""
    return marshal.dumps(compile(source, shown, "exec", dont_inherit=True, optimize=0), WITHOUT_REFERENCES)
