"""Tries to leave changed defaults of functions to the next run."""
# ends: finished

import statistics
import textwrap


def task_program():
    textwrap.fill.__defaults__ = (7,)
    statistics.quantiles.__kwdefaults__["n"] = 2
