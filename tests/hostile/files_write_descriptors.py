"""Tries to write to every descriptor but its own line."""
# ends: finished

import os


def task_program():
    for descriptor in [0, 1, 2, *range(4, 64)]:
        try:
            os.write(descriptor, b"I was here")
            say("written")
        except PermissionError:
            pass
