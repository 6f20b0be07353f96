"""Tries to take back what ends it when the fork server ends, and to widen its limits."""
# ends: finished
# does: say 6 refused

import ctypes


def task_program():
    kernel = ctypes.CDLL(None)
    refused = sum(kernel.prctl(option, value, 0, 0, 0) == -1 for option, value in ((1, 0), (4, 1), (36, 1)))
    unlimited = b"\xff" * 16
    refused += kernel.setrlimit(0, unlimited) == -1
    refused += kernel.setrlimit(9, unlimited) == -1
    refused += kernel.prlimit(0, 7, unlimited, None) == -1
    say(f"{refused} refused")
