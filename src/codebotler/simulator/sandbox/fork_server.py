"""Forks a process for each run or batch from the same memory image, and reports how each process ended."""

from __future__ import annotations

import gc
import os
import sys
from _socket import CMSG_SPACE, socket
from marshal import loads
from posix import getpid, getppid

from codebotler.simulator.sandbox import CHANNEL, CPU_SECONDS, LIVE_CPU_SECONDS, LIVE_RUN, READY
from codebotler.simulator.sandbox.channel import receive, send
from codebotler.simulator.sandbox.environment import simulate_environment
from codebotler.simulator.sandbox.execution import ProgramRun
from codebotler.simulator.sandbox.isolation import die_with_parent, enclose, give_up_rights, usable_filter
from codebotler.simulator.sandbox.stdlib import load_stdlib

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import NoReturn, TypeVar

    from codebotler.simulator.sandbox.isolation import Filter

    Run = TypeVar("Run", bound=ProgramRun)

RUN_DOOR, REPORT_DESCRIPTOR = 4, 5  # descriptors for requests of runs, and for reported numbers
PID_BYTES = 8  # size of a process id as bytes; the size of an int object would depend on its value
DESCRIPTOR_BYTES = 4  # size of a descriptor in a message


def get_ready() -> tuple[socket, ProgramRun, Callable[[ProgramRun], None], Filter | None, int]:
    """Prepare everything that all runs share, and return the arguments for `serve`."""
    door = socket(fileno=RUN_DOOR)
    run = ProgramRun()
    simulate_environment(run)
    run.provide(loads(door.recv(1 << 16)))  # noqa: S302 - from the engine
    load_stdlib(run)
    sys.pycache_prefix = None
    for name in [name for name in sys.modules if name.partition(".")[0] == "codebotler"]:
        del sys.modules[name]
    for module in sys.modules.values():
        if hasattr(module, "__path__"):
            module.__path__ = [""]  # hides this machine's folders; `logging` needs an entry
            if module.__spec__ is not None:
                module.__spec__.submodule_search_locations = module.__path__
    sys.meta_path[:] = [_NothingMore()]
    give_up_rights()
    return door, run, execute, usable_filter(), CPU_SECONDS


def serve(
    door: socket, run: Run, execute: Callable[[Run], None], seccomp: Filter | None, seconds: int
) -> None:
    """Fork a child for each request on the socket `door`, one at a time, until the engine hangs up.

    Each child calls `execute` with `seccomp` in force and `seconds` of processor time.
    """
    gc.collect()
    gc.freeze()
    _report(0 if seccomp is None else 1)
    while _one_run(door, run, execute, seccomp, seconds):
        pass


class _NothingMore:
    """Importer that finds nothing, since all permitted modules are already imported."""

    def find_spec(self, name: str, *_: object) -> NoReturn:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def _one_run(
    door: socket, run: Run, execute: Callable[[Run], None], seccomp: Filter | None, seconds: int
) -> bool:
    """Fork the child for one run, and report its process id and later its exit status.

    The dead child is reaped when the next run is requested, so that its process id is not reused earlier.
    """
    descriptor, is_live = _asked_for(door)
    if descriptor < 0:
        return False
    parent = getpid().to_bytes(PID_BYTES, "big")
    pid = os.fork()
    if pid == 0:
        try:
            isolate(descriptor, seccomp, LIVE_CPU_SECONDS if is_live else seconds, parent)
            execute(run)
            os._exit(0)
        finally:
            os._exit(1)
    os.close(descriptor)
    _report(pid)
    _report(_end_of(pid))
    return True


def _asked_for(door: socket) -> tuple[int, bool]:
    """Reap the last child at the next request. Return its socket, or -1 at the end, and if it is live."""
    request, ancillary, _, _ = door.recvmsg(1, CMSG_SPACE(DESCRIPTOR_BYTES))
    if not ancillary:
        return -1, False
    try:  # noqa: SIM105 - contextlib is too large to import
        os.waitpid(-1, 0)
    except ChildProcessError:
        pass
    return int.from_bytes(ancillary[0][2][:DESCRIPTOR_BYTES], sys.byteorder), request == LIVE_RUN


def _end_of(pid: int) -> int:
    """Wait for a child to end, and return its exit status or negative signal number."""
    if sys.platform != "linux":  # macOS has `waitid` only since Python 3.13
        return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    ended = os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    if ended is None:
        return 0
    return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status


def isolate(descriptor: int, seccomp: Filter | None, seconds: int, parent: bytes) -> None:
    """Isolate this child of the process `parent`: keep only a socket open, limit its time, apply seccomp."""
    os.dup2(descriptor, CHANNEL)
    os.closerange(CHANNEL + 1, 256)
    die_with_parent()
    if getppid().to_bytes(PID_BYTES, "big") != parent:  # the parent has died already
        os._exit(1)
    enclose(seccomp, seconds)


def execute(run: ProgramRun) -> None:
    """Run the program that the engine sends, and report how it ended."""
    send(READY)
    code, skills, parameters = receive()
    if skills != run.skills:
        run.provide(skills)
    send(run.execute(code, parameters))


def _report(number: int) -> None:
    os.write(REPORT_DESCRIPTOR, number.to_bytes(8, sys.byteorder, signed=True))
