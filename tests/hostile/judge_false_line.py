"""Tries to lie about the line on which it ended."""
# ends: python-error ValueError


def task_program():
    exec(compile("\n" * 10**6 + "raise ValueError", "<program>", "exec"))
