"""Tries to execute what a descriptor holds."""
# ends: python-error PermissionError

import os


def task_program():
    os.execve(0, ["@MARKER@"], {})
