"""Tries to wait in real time, a twentieth of a second at a time."""
# ends: finished
# does: 2 times say -100

import ctypes


def task_program():
    kernel, word, a_while = ctypes.CDLL(None), (ctypes.c_int * 1)(), (ctypes.c_long * 2)(0, 50_000_000)
    futex_of_x86, futex_of_arm = 202, 98
    for futex in (futex_of_x86, futex_of_arm):
        say(str(sum(kernel.syscall(futex, word, 0, 0, a_while) for _ in range(100))))
