"""Commands of a shell, each forked from a process that has imported what most of them need."""

from __future__ import annotations

import importlib
import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from forked import LONGEST, PROGRAMS, become


@contextmanager
def forking(address: Path) -> Iterator[None]:
    """Let scripts with this address be commands."""
    command = [sys.executable, __file__, str(address)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.read()  # until it listens
        yield
        process.terminate()


# --- in the process that forks


def serve(door: socket.socket) -> list[str]:
    """Fork a process for each command, and one that tells its status; in the former, return its words."""
    while True:
        line, _ = door.accept()
        with suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:  # those that have told theirs
                pass
        data, descriptors, *_ = socket.recv_fds(line, LONGEST, 3)
        if os.fork() == 0:
            door.close()
            pid = os.fork()
            if pid == 0:
                line.close()
                request = json.loads(data)
                become(request, descriptors)
                return list(request["words"])
            line.send(b"%d" % (os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) % 256))
            os._exit(0)
        for number in (line.detach(), *descriptors):
            os.close(number)


if __name__ == "__main__":
    mains = {name: importlib.import_module(f"{name}.__main__").main for name in ("codebotler", "roboeval")}
    for module in (*PROGRAMS, "openai.resources.chat"):
        importlib.import_module(module)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listening:
        listening.bind(sys.argv[1])
        listening.listen()
        os.dup2(2, 1)  # ends the output, which tells that it listens
        called = serve(listening)
    mains[called[0]]()
