"""Tries to empty a file without opening it."""
# ends: python-error PermissionError

import os


def task_program():
    os.truncate("@CANARY_FOLDER@/canary", 0)
