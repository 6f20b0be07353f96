"""Tries to call itself without end."""
# ends: python-error RecursionError


def task_program():
    task_program()
