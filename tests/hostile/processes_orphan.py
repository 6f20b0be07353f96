"""Tries to leave a process of its own session that outlives the run."""
# ends: finished

import os


def task_program():
    for step in (os.setsid, os.fork, os.setpgrp, os.forkpty):
        try:
            if step() == 0 and step is os.fork:
                os.execv("/bin/sleep", ["@MARKER@", "60"])
            say(step.__name__)
        except OSError:
            pass
