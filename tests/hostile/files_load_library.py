"""Tries to load a shared library, which would be code of its own."""
# ends: python-error OSError

import ctypes


def task_program():
    ctypes.CDLL("@SECRET_FOLDER@/hushed.so")
