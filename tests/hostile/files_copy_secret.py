"""Tries to copy a secret file to where everybody can read it."""
# ends: python-error PermissionError

import tempfile


def task_program():
    tempfile._shutil.copyfile("@SECRET_FILE@", "@CANARY_FOLDER@/copy")
