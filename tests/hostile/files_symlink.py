"""Tries to leave a symbolic link to a secret file."""
# ends: python-error PermissionError

import os


def task_program():
    os.symlink("@SECRET_FILE@", "@CANARY_FOLDER@/link")
