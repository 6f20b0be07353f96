"""Tries to list a folder."""
# ends: python-error PermissionError

import os


def task_program():
    say(" ".join(os.listdir("@CANARY_FOLDER@")))
