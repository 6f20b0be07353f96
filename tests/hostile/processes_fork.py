"""Tries to fork."""
# ends: python-error PermissionError

import os


def task_program():
    os.fork()
