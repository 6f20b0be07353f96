"""Tries to delete a file."""
# ends: python-error PermissionError

import os


def task_program():
    os.remove("@CANARY_FOLDER@/canary")
