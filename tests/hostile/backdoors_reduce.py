"""Tries to run a command as a pickle would, by what an object says of its making."""
# ends: finished
# does: say failed

import copy
import os


class Made:
    def __reduce__(self):
        return os.system, ("echo I was here > @CANARY_FOLDER@/new",)


def task_program():
    say("failed" if copy.copy(Made()) else "done")
