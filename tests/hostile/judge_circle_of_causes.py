"""Tries to fail with an error that is its own cause."""
# ends: python-error ValueError


def task_program():
    error = ValueError()
    error.__context__ = error.__cause__ = error
    raise error
