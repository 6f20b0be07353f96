"""Tries to fork, clone and execute by the numbers of system calls."""
# ends: finished
# does: say -1 -1 -1 -1

import ctypes


def task_program():
    kernel = ctypes.CDLL(None)
    fork, clone, clone3, execve = 57, 56, 435, 59
    arguments = bytes(8)
    say(
        f"{kernel.syscall(fork)} {kernel.syscall(clone, 17, 0, 0, 0, 0)} {kernel.syscall(clone3, bytes(88), 88)} "
        f"{kernel.syscall(execve, b'/bin/true', arguments, arguments)}"
    )
