"""Tries to have the interpreter itself write to its line."""
# ends: killed Crash

import inspect


def task_program():
    faulthandler = inspect.importlib._bootstrap._builtin_from_name("faulthandler")
    faulthandler.dump_traceback(3)
