"""Tries to open a file relative to descriptors that were left open."""
# ends: finished

import os


def task_program():
    for descriptor in range(64):
        try:
            say(os.read(os.open("../" * 9 + "@SECRET_FILE@", os.O_RDONLY, dir_fd=descriptor), 100).decode())
        except PermissionError:
            pass
