"""Tries to give a secret file a second name."""
# ends: python-error PermissionError

import os


def task_program():
    os.link("@SECRET_FILE@", "@CANARY_FOLDER@/link")
