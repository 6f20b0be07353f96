"""Tries to open sockets and rings by the numbers of system calls."""
# ends: finished
# does: say -1 -1 -1 -1

import ctypes


def task_program():
    kernel = ctypes.CDLL(None)
    io_uring_setup = 425
    say(
        f"{kernel.socket(2, 1, 0)} {kernel.socket(1, 1, 0)} {kernel.syscall(io_uring_setup, 8, bytes(120))} "
        f"{kernel.bind(3, b'', 0)}"
    )
