"""Tries to take the functions away that the engine's side of the process may need to end it."""
# ends: python-error ZeroDivisionError

import builtins


def task_program():
    builtins.open = builtins.print = builtins.eval = builtins.sorted = builtins.map = builtins.id = None
    1 / 0
