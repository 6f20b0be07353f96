"""Tries to hold on to the engine by a descriptor."""
# ends: python-error PermissionError

import os


def task_program():
    os.pidfd_open(@PARENT_PID@)
