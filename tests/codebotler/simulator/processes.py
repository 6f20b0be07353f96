"""Queries about the processes of this machine, for tests of the engine."""

import contextlib
import os
import time
from pathlib import Path


def parents() -> dict[int, int]:
    """Return the parent of each process."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            stat = (folder / "stat").read_text(encoding="ascii", errors="replace")
            found[int(folder.name)] = int(stat.rpartition(")")[2].split()[1])
    return found


def children_of(pid: int) -> set[int]:
    """Return all descendants of a process."""
    above = parents()
    found: set[int] = set()
    while more := {one for one, parent in above.items() if parent in {pid, *found}} - found:
        found |= more
    return found


def is_alive(pid: int) -> bool:
    """Return whether a process runs; a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def are_gone(pids: set[int]) -> bool:
    """Return whether processes end within a few seconds; a zombie has ended."""
    for _ in range(200):
        if not any(map(is_alive, pids)):
            return True
        time.sleep(0.02)
    return False


def fork_servers() -> set[int]:
    """Return the isolated children of this process, without other processes that tests started."""
    return {pid for pid, parent in parents().items() if parent == os.getpid() and _is_isolated(pid)}


def _is_isolated(pid: int) -> bool:
    try:
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False
    return any(code in command for code in (b"sandbox/start.py", b"simulator.batches.process"))


def engine_processes() -> set[int]:
    """Return all processes of the engine below this process."""
    return {pid for server in fork_servers() for pid in {server, *children_of(server)}}
