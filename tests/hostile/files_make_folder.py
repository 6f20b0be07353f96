"""Tries to make a folder, a pipe and a device, and goes on when one is refused."""
# ends: finished

import os


def task_program():
    for make in (os.mkdir, os.mkfifo, os.mknod):
        try:
            make("@CANARY_FOLDER@/" + make.__name__)
            say(make.__name__)
        except PermissionError:
            pass
