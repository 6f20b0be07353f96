"""Tries to pass the list of allowed system calls by the numbers of another interface."""
# ends: killed ForbiddenCall

import ctypes


def task_program():
    x32, getpid = 0x40000000, 39
    say(str(ctypes.CDLL(None).syscall(x32 + getpid)))
