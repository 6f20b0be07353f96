"""Tries to close its line and to move it elsewhere, and goes on when that is refused."""
# ends: finished

import os


def task_program():
    for cut in (lambda: os.close(3), lambda: os.dup2(3, 4), lambda: os.dup2(0, 3), lambda: os.set_blocking(3, False)):
        try:
            cut()
            say("cut")
        except PermissionError:
            pass
