"""Tries to put its own function in the place of the one that counts."""
# ends: timeout TimeoutError

import builtins


def task_program():
    for name in list(vars(builtins)):
        if name.startswith("<"):
            setattr(builtins, name, int)
    while True:
        pass
