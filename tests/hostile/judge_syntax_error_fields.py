"""Tries to end in an error of syntax whose line is no number."""
# ends: python-error SyntaxError


def task_program():
    error = SyntaxError("x")
    error.lineno, error.filename = object(), "<program>"
    raise error
