"""Tries to kill the process that it was forked from."""
# ends: python-error PermissionError

import os
import signal


def task_program():
    os.kill(@FORK_SERVER_PID@, signal.SIGKILL)
