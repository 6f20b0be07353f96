"""Tries to leave the engine's part of the process no memory for an answer."""
# ends: python-error MemoryError

import itertools


def task_program():
    hoard = []
    for size in (10**8, 10**7, 10**6, 10**5, 10**4):
        while True:
            try:
                hoard.append(bytearray(size))
            except MemoryError:
                break
    hoard.extend(itertools.repeat(None))
