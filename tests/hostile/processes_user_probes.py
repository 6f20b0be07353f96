"""Tries the two calls of user probes, which newer kernels let past any list."""
# ends: finished | killed Crash
# does: say -1

import ctypes


def task_program():
    kernel, uretprobe, uprobe = ctypes.CDLL(None), 335, 336
    say(str(kernel.syscall(uprobe)))
    kernel.syscall(uretprobe)
