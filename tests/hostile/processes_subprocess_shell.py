"""Tries to read the output of a shell."""
# ends: python-error PermissionError

import subprocess


def task_program():
    say(subprocess.check_output("cat @SECRET_FILE@", shell=True, text=True))
