"""Tries to exhaust the stack of the compiler with blocks in blocks."""
# ends: python-error IndentationError


def task_program():
    exec("".join("    " * depth + "if 1:\n" for depth in range(1000)) + "    " * 1000 + "pass")
