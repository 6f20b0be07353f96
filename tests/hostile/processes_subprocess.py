"""Tries to start a process that keeps no line to it."""
# ends: python-error PermissionError

import subprocess


def task_program():
    subprocess.Popen(["sleep", "60", "@MARKER@"], start_new_session=True, close_fds=False)
