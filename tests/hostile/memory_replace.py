"""Tries to blow up a string by replacing each character."""
# ends: python-error MemoryError


def task_program():
    ("x" * 10**6).replace("x", "y" * 10**6)
