"""Forks one child a run, each from the same heap, and reports how it ended."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import os
import platform
import select
import signal
import socket
import struct
from typing import NoReturn

from codebotler.simulator.sandbox.channel import CHANNEL, receive, send
from codebotler.simulator.sandbox.execution import Run
from codebotler.simulator.sandbox.surroundings import simulate_surroundings
from codebotler.simulator.sandbox.walls import can_install, enclose, seccomp_filter

WAKE, DOOR, REPORT = 4, 5, 6

PRELOADED = """
    abc array asyncio base64 bisect calendar cmath codecs collections collections.abc colorsys
    concurrent.futures contextlib copy csv dataclasses datetime _strptime decimal difflib enum fractions
    functools hashlib heapq html inspect io itertools json keyword locale logging math numbers operator
    os os.path pathlib pprint queue random re secrets shlex signal socket statistics string struct
    subprocess sys tempfile textwrap threading time timeit traceback types typing unicodedata unittest
    unittest.mock uuid warnings weakref zoneinfo encodings.ascii encodings.base64_codec
    encodings.charmap encodings.cp1252 encodings.hex_codec encodings.idna encodings.latin_1
    encodings.punycode encodings.raw_unicode_escape encodings.rot_13 encodings.unicode_escape
    encodings.utf_16 encodings.utf_16_be encodings.utf_16_le encodings.utf_32 encodings.utf_7
    encodings.utf_8 encodings.utf_8_sig
""".split()  # noqa: SIM905 - a list of a hundred quoted words is no easier to read


def serve() -> None:
    """Serve runs, one at a time, until the engine closes its end.

    All that a program may import is imported here: the walls allow no file to be opened later.
    """
    for name in PRELOADED:
        importlib.import_module(name)
    seccomp = seccomp_filter(platform.machine())
    if seccomp is not None and not can_install(seccomp):
        seccomp = None
    door = socket.socket(fileno=DOOR)
    gc.collect()
    gc.freeze()
    os.write(REPORT, struct.pack("=q", 0 if seccomp is None else 1))
    while one_run(door, seccomp):
        pass


def child(door: socket.socket, seccomp: ctypes.Array[ctypes.c_char] | None, parent: int) -> NoReturn:
    """Be the child of one run: take the channel, close the walls, run the program, say how it ended."""
    descriptors = socket.recv_fds(door, 1, 1)[1]
    os.dup2(descriptors[0], CHANNEL)
    os.closerange(CHANNEL + 1, 256)
    job = receive()
    enclose(job, seccomp, parent)
    send("ready")
    run = Run(job)
    simulate_surroundings(run)
    send(run.execute())
    os._exit(0)


def one_run(door: socket.socket, seccomp: ctypes.Array[ctypes.c_char] | None) -> bool:
    """Fork the child of one run and report its process id and, at its end, its wait status.

    The dead child is reaped only when the next run is asked for, so that until then its id stays its own. All
    that is allocated here is freed on return, so that every child starts from the same heap.
    """
    if not os.read(WAKE, 1):
        return False
    with contextlib.suppress(ChildProcessError):
        os.waitpid(-1, 0)
    parent = os.getpid()
    pid = os.fork()
    if pid == 0:
        try:
            child(door, seccomp, parent)
        finally:
            os._exit(1)
    os.write(REPORT, struct.pack("=q", pid))
    watch = os.pidfd_open(pid)
    if watch not in select.select([watch, WAKE], [], [])[0]:
        os.kill(pid, signal.SIGKILL)  # the engine is gone
    os.close(watch)
    ended = os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
    status = 0 if ended is None else ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
    os.write(REPORT, struct.pack("=q", status))
    return True
