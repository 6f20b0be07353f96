"""Tries to kill every process that it may."""
# ends: python-error PermissionError

import os
import signal


def task_program():
    os.kill(-1, signal.SIGKILL)
