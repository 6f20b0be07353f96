"""Tries to leave words in the environment to the next run."""
# ends: finished

import os


def task_program():
    os.environ["I_WAS_HERE"] = "yes"
    os.putenv("PYTHONHASHSEED", "7")
    os.unsetenv("TZ")
