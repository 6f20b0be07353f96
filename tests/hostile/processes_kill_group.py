"""Tries to kill the groups of its own and of the engine."""
# ends: finished

import os
import signal


def task_program():
    for group in (0, @PARENT_PID@, @FORK_SERVER_PID@, @BYSTANDER_PID@):
        try:
            os.killpg(group, signal.SIGTERM)
            say("killed")
        except PermissionError:
            pass
