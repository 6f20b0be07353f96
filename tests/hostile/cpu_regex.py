"""Tries to compute for hours with a regular expression that backtracks."""
# ends: timeout TimeoutError

import re


def task_program():
    re.match("(a+)+$", "a" * 60 + "b")
