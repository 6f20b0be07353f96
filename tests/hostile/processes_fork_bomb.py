"""Tries to fork for ever, however often it is refused."""
# ends: timeout TimeoutError

import os


def task_program():
    while True:
        try:
            os.fork()
        except OSError:
            pass
