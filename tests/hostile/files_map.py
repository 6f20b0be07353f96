"""Tries to map files into memory by the descriptors it was left."""
# ends: finished
# does: say 0

import ctypes


def task_program():
    mmap = ctypes.CDLL(None).mmap
    mmap.restype = ctypes.c_ssize_t
    mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_size_t]
    shared, readable = 1, 1
    mapped = [one for one in range(64) if mmap(None, 4096, readable, shared, one, 0) != -1]
    say(str(len(mapped)))
