"""Tries to compute for hours in one step."""
# ends: timeout TimeoutError


def task_program():
    sum(range(10**12))
