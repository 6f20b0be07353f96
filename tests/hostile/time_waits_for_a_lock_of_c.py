"""Tries to wait for a lock that Python does not know, a twentieth of a second at a time."""
# ends: killed Crash

import ctypes


def task_program():
    python = ctypes.pythonapi
    python.PyThread_allocate_lock.restype = ctypes.c_void_p
    lock, microseconds = ctypes.c_void_p(python.PyThread_allocate_lock()), ctypes.c_longlong(50_000)
    python.PyThread_acquire_lock(lock, 1)
    for _ in range(80):
        python.PyThread_acquire_lock_timed(lock, microseconds, 0)
    say("waited")
