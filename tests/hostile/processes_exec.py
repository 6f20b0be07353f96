"""Tries to become another program."""
# ends: python-error PermissionError

import os


def task_program():
    os.execv("/bin/cat", ["cat", "@SECRET_FILE@"])
