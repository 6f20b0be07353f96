"""Tries to start a process by posix_spawn."""
# ends: python-error PermissionError

import os


def task_program():
    os.posix_spawn("/bin/sleep", ["sleep", "60", "@MARKER@"], {})
