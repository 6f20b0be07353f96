"""Tries to fill the memory with a format."""
# ends: python-error MemoryError


def task_program():
    say(format(1, f"{10**11}"))
