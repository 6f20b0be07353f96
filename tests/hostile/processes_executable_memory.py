"""Tries to make memory executable, for code that no compiler of Python made."""
# ends: finished
# does: say -1 -1

import ctypes


def task_program():
    mmap = ctypes.CDLL(None).mmap
    mmap.restype = ctypes.c_ssize_t
    mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_size_t]
    readable, writable, executable, private, anonymous = 1, 2, 4, 2, 0x20
    code = mmap(None, 4096, readable | writable | executable, private | anonymous, -1, 0)
    data = mmap(None, 4096, readable | writable, private | anonymous, -1, 0)
    mprotect = ctypes.CDLL(None).mprotect
    mprotect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
    say(f"{code} {mprotect(data, 4096, readable | executable)}")
