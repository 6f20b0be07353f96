"""Tries to open sockets and rings by the numbers of system calls."""
# ends: finished
# does: say -1 -1 -1 -1


def task_program():
    frame = sys._getframe()
    while "ctypes" not in frame.f_globals:
        frame = frame.f_back
    kernel = frame.f_globals["ctypes"].CDLL(None)
    io_uring_setup = 425
    say(
        f"{kernel.socket(2, 1, 0)} {kernel.socket(1, 1, 0)} {kernel.syscall(io_uring_setup, 8, bytes(120))} "
        f"{kernel.bind(3, b'', 0)}"
    )
