"""Tries to fill a record with the message of its error."""
# ends: python-error ValueError


def task_program():
    raise ValueError("m" * 10**7)
