"""Tries to learn what its descriptors are, and to open them anew."""
# ends: python-error PermissionError

import os


def task_program():
    say(os.readlink("/proc/self/fd/3"))
