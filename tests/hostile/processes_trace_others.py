"""Tries to trace and to rewrite other processes."""
# ends: finished
# does: say 15 refused

import ctypes


def task_program():
    kernel = ctypes.CDLL(None)
    attach, seize = 16, 0x4206
    refused = 0
    for pid in (@PARENT_PID@, @FORK_SERVER_PID@, @BYSTANDER_PID@):
        refused += kernel.ptrace(attach, pid, 0, 0) == -1
        refused += kernel.ptrace(seize, pid, 0, 0) == -1
        refused += kernel.process_vm_readv(pid, bytes(16), 1, bytes(16), 1, 0) == -1
        refused += kernel.process_vm_writev(pid, bytes(16), 1, bytes(16), 1, 0) == -1
        refused += kernel.syscall(312, pid, pid, 0, 0, 0) == -1  # kcmp
    say(f"{refused} refused")
