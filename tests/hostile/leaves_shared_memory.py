"""Tries to leave memory that the next run can find."""
# ends: finished
# does: say -1 -1 -1 -1

import ctypes


def task_program():
    kernel = ctypes.CDLL(None)
    own, create = 0x6875, 0o1666
    say(
        f"{kernel.shmget(own, 4096, create)} {kernel.semget(own, 1, create)} {kernel.msgget(own, create)} "
        f"{kernel.shm_open(b'/@MARKER@', 0o102, 0o666)}"
    )
