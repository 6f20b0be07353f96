"""Tries to write a number with very many digits into its source."""
# ends: python-error SyntaxError


def task_program():
    eval("9" * 1_000_000)
