"""Tries to kill the process that judges it."""
# ends: python-error PermissionError

import os
import signal


def task_program():
    os.kill(@PARENT_PID@, signal.SIGKILL)
