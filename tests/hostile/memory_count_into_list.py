"""Tries to list all numbers."""
# ends: python-error MemoryError

import itertools


def task_program():
    list(itertools.count(10**6))
