"""The zygote's script: prepares a process that is the same in every start, then serves runs."""

from __future__ import annotations

import ctypes
import fcntl
import os
import sys
from typing import NoReturn

WAKE = 4
ADDR_NO_RANDOMIZE = 0x0040000


def main(descriptors: list[str]) -> None:
    """Start, at first only to start again."""
    if descriptors:
        start_again(list(map(int, descriptors)))
    root = __file__.rsplit("/codebotler/", 1)[0]
    sys.path.append(root)
    sys.pycache_prefix = (
        os.devnull
    )  # bytecode may be there in one start and not in the next, and moves the heap
    from codebotler.simulator.sandbox.forking import serve  # noqa: PLC0415 - only now it can be found

    sys.path.remove(root)
    sys.pycache_prefix = None
    serve()


def start_again(descriptors: list[int]) -> NoReturn:
    """Become the zygote, with what the engine handed over at fixed numbers and with fixed addresses.

    A program may say an address. It must be the same in every start, and even the lengths of arguments and
    the numbers of descriptors would move it.
    """
    end = WAKE + len(descriptors)
    copies = [fcntl.fcntl(descriptor, fcntl.F_DUPFD, end) for descriptor in descriptors]
    for number, copy in enumerate(copies, WAKE):
        os.dup2(copy, number, inheritable=True)
    os.closerange(end, 65536)
    ctypes.CDLL(None).personality(ctypes.c_ulong(ADDR_NO_RANDOMIZE))
    os.execv(sys.executable, sys.orig_argv[: -len(descriptors)])  # noqa: S606 - the same program again


if __name__ == "__main__":
    main(sys.argv[1:])
