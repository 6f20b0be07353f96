"""Tries to take all memory in many small things that no loop of its own counts."""
# ends: python-error MemoryError

import itertools


def task_program():
    list(map(bytes, itertools.repeat(1000)))
