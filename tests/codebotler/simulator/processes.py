"""The processes of this machine, as tests of the engine look at them."""

import contextlib
import os
import time
from pathlib import Path


def parents() -> dict[int, int]:
    """The parent of each process, at one moment."""
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            stat = (folder / "stat").read_text(encoding="ascii", errors="replace")
            found[int(folder.name)] = int(stat.rpartition(")")[2].split()[1])
    return found


def children_of(pid: int) -> set[int]:
    """All processes below one."""
    above = parents()
    found: set[int] = set()
    while more := {one for one, parent in above.items() if parent in {pid, *found}} - found:
        found |= more
    return found


def lives(pid: int) -> bool:
    """Whether a process has not ended; one that waits to be buried has."""
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def are_gone(pids: set[int]) -> bool:
    """Whether processes end within a few seconds; one that waits to be buried counts as ended."""
    for _ in range(200):
        if not any(map(lives, pids)):
            return True
        time.sleep(0.02)
    return False


def fork_servers() -> set[int]:
    """The isolated processes directly below this one; not what else tests have started."""
    return {pid for pid, parent in parents().items() if parent == os.getpid() and _is_isolated(pid)}


def _is_isolated(pid: int) -> bool:
    try:
        command = Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return False
    return any(code in command for code in (b"sandbox/start.py", b"simulator.batches.process"))


def engine_processes() -> set[int]:
    """All processes of the engine below this one."""
    return {pid for server in fork_servers() for pid in {server, *children_of(server)}}
