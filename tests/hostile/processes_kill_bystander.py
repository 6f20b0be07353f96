"""Tries to kill a process of the same user that has nothing to do with it."""
# ends: python-error PermissionError

import os
import signal


def task_program():
    os.kill(@BYSTANDER_PID@, signal.SIGKILL)
