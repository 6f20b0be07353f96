"""Tries to walk through folders with a function that keeps quiet about errors."""
# ends: finished
# does: say 0

import os


def task_program():
    say(str(len(list(os.walk("@CANARY_FOLDER@")) + list(os.walk("/")))))
