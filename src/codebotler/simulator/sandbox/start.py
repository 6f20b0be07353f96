"""The script of every isolated process: makes it the same in every start, then hands over to its role."""

from __future__ import annotations

import ctypes
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import NoReturn

FIRST = 4
STACK = 8 * 1024 * 1024
ADDR_NO_RANDOMIZE = 0x0040000


def main(role: str, descriptors: list[str]) -> None:
    """Start, at first only to start again.

    Args:
        role: what to become.
        descriptors: what the engine handed over; none in the second start, where they begin at FIRST.
    """
    if descriptors:
        start_again(list(map(int, descriptors)))
    root = __file__.rsplit("/codebotler/", 1)[0]
    sys.path.append(root)
    sys.pycache_prefix = os.devnull  # bytecode, there in one start and not in the next, would move the heap
    if role == "preparer":
        from codebotler.simulator.sandbox import preparing  # noqa: PLC0415 - only now it can be found

        preparing.serve()
    else:
        from codebotler.simulator.sandbox import forking  # noqa: PLC0415 - the same

        forking.serve(root, library=role == "library-zygote")


def start_again(descriptors: list[int]) -> NoReturn:
    """Become the role, with what the engine handed over at fixed numbers and with fixed addresses.

    A program may say an address. It must be the same in every start, and even the lengths of arguments and
    the numbers of descriptors would move it.
    """
    from fcntl import F_DUPFD, fcntl  # noqa: PLC0415 - the second start, which is forked, has no use for it

    forget_the_shell()
    end = FIRST + len(descriptors)
    copies = [fcntl(descriptor, F_DUPFD, end) for descriptor in descriptors]
    for number, copy in enumerate(copies, FIRST):
        os.dup2(copy, number, inheritable=True)
    os.closerange(end, 65536)
    if sys.platform == "linux":
        ctypes.CDLL(None).personality(ctypes.c_ulong(ADDR_NO_RANDOMIZE))
    os.execv(sys.executable, sys.orig_argv[: -len(descriptors)])  # noqa: S606 - the same program again


def forget_the_shell() -> None:
    """Undo what a shell may have set and a process inherits: ignored signals, the size of the stack."""
    import _signal  # type: ignore[import-not-found] # noqa: PLC0415 - the second start has no use for it
    from resource import RLIMIT_STACK, getrlimit, setrlimit  # noqa: PLC0415 - the same

    for number in _signal.valid_signals() - {_signal.SIGKILL, _signal.SIGSTOP}:
        _signal.signal(number, _signal.SIG_DFL)
    _signal.pthread_sigmask(_signal.SIG_SETMASK, ())
    _, hard = getrlimit(RLIMIT_STACK)
    setrlimit(RLIMIT_STACK, (STACK if hard < 0 else min(STACK, hard), hard))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
