"""Tries to rename a file."""
# ends: python-error PermissionError

import os


def task_program():
    os.replace("@CANARY_FOLDER@/canary", "@CANARY_FOLDER@/cat")
