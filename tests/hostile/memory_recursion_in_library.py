"""Tries to exhaust the stack of the interpreter with a list in lists."""
# ends: python-error RecursionError


def task_program():
    nested = []
    for _ in range(150_000):
        nested = [nested]
    repr(nested)
