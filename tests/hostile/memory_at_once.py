"""Tries to take all memory in one piece."""
# ends: python-error MemoryError


def task_program():
    "x" * 10**12
