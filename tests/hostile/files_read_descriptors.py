"""Tries to read from every descriptor but its own line."""
# ends: finished

import os


def task_program():
    for descriptor in [0, 1, 2, *range(4, 64)]:
        for read in (os.read, os.pread):
            try:
                say(read(descriptor, 100, *[0][: read is os.pread]).decode())
            except PermissionError:
                pass
