"""Tries to leave other rights of new files to the next run."""
# ends: python-error OSError

import os


def task_program():
    os.umask(0)
