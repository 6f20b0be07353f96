"""Tries to call itself without end after lifting the limit."""
# ends: timeout TimeoutError


def deeper():
    deeper()


def task_program():
    sys.setrecursionlimit(2**31 - 1)
    deeper()
