"""Tries to list all combinations."""
# ends: python-error MemoryError

import itertools


def task_program():
    list(itertools.product(range(100), repeat=9))
