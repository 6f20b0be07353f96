"""Tries to make a temporary folder in a place that everybody may write to."""
# ends: python-error PermissionError

import tempfile


def task_program():
    tempfile.mkdtemp(dir="@CANARY_FOLDER@")
