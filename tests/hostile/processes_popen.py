"""Tries to read the output of a command."""
# ends: python-error PermissionError

import os


def task_program():
    say(os.popen("cat @SECRET_FILE@").read())
