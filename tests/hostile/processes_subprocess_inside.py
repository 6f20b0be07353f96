"""Tries to start a process by the function that subprocess itself uses."""
# ends: python-error PermissionError

import subprocess


def task_program():
    command = (["sleep", "60", "@MARKER@"], [b"/bin/sleep"], True, (3,), None, None)
    streams = (-1, -1, -1, -1, -1, -1, 3, 3)
    who = (True, True, -1, None, None, None, -1, None, True)
    subprocess._fork_exec(*command, *streams, *who)
