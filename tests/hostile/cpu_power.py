"""Tries to compute for hours with one huge number."""
# ends: timeout TimeoutError


def task_program():
    3 ** (10**9)
