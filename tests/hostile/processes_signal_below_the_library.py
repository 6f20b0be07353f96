"""Tries to signal others by every system call that there is for it."""
# ends: finished
# does: say 24 refused

import ctypes


def task_program():
    call = ctypes.CDLL(None).syscall
    kill, tkill, tgkill, queue, pidfd_open, pidfd_send = 62, 200, 234, 129, 434, 424
    refused = 0
    for pid in (@PARENT_PID@, @FORK_SERVER_PID@, @BYSTANDER_PID@):
        for number in (10, 19):
            refused += call(kill, pid, number) == -1
            refused += call(tkill, pid, number) == -1
            refused += call(tgkill, pid, pid, number) == -1
            refused += call(queue, pid, number, bytes(128)) == -1
    say(f"{refused} refused")
    for descriptor in range(64):
        call(pidfd_send, descriptor, 9, 0, 0)
