"""Tries to swallow the end of its budget without a line of its own that is counted."""
# ends: timeout TimeoutError

from contextlib import suppress


def task_program():
    while True:
        with suppress(BaseException):
            while True:
                pass
