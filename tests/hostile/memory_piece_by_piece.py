"""Tries to take all memory in big pieces."""
# ends: python-error MemoryError


def task_program():
    parts = []
    while True:
        parts.append(bytearray(10**7))
