"""Tries to delete a whole folder with the shutil that tempfile holds."""
# ends: python-error PermissionError

import tempfile


def task_program():
    tempfile._shutil.rmtree("@CANARY_FOLDER@")
