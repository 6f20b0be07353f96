"""Tries to exhaust the stack of the parser."""
# ends: python-error SyntaxError


def task_program():
    eval("(" * 100_000 + ")" * 100_000)
