"""Tries to write a file through pathlib."""
# ends: python-error PermissionError

import pathlib


def task_program():
    (pathlib.Path("@CANARY_FOLDER@") / "new").write_text("I was here")
