"""Tries to run a command in a shell."""
# ends: finished
# does: say failed

import os


def task_program():
    status = os.system("echo I was here > @CANARY_FOLDER@/new; sleep 60 # @MARKER@")
    say("failed" if status else "done")
