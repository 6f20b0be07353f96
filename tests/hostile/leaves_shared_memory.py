"""Tries to leave memory that the next run can find."""
# ends: finished
# does: say -1 -1 -1 -1


def task_program():
    frame = sys._getframe()
    while "ctypes" not in frame.f_globals:
        frame = frame.f_back
    kernel = frame.f_globals["ctypes"].CDLL(None)
    own, create = 0x6875, 0o1666
    say(
        f"{kernel.shmget(own, 4096, create)} {kernel.semget(own, 1, create)} {kernel.msgget(own, create)} "
        f"{kernel.shm_open(b'/@MARKER@', 0o102, 0o666)}"
    )
