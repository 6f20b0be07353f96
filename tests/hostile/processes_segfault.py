"""Tries to crash its interpreter."""
# ends: killed Crash

import ctypes


def task_program():
    ctypes.string_at(0)
