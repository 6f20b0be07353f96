"""Tries to hide a long loop in a sort."""
# ends: timeout TimeoutError


def task_program():
    sorted(range(10**6), key=lambda number: -number)
