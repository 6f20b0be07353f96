"""Tries to leave changed builtins to the next run."""
# ends: finished

import builtins


def task_program():
    builtins.sorted = lambda *_: ["I was here"]
    builtins.I_WAS_HERE = True
    builtins.hash = builtins.id = lambda _: 7
