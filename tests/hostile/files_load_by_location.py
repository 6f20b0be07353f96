"""Tries to load a module that holds a secret by the path of its file."""
# ends: python-error PermissionError

import inspect


def task_program():
    loader = inspect.importlib._bootstrap_external.SourceFileLoader("hushed", "@SECRET_FOLDER@/hushed.py")
    say(loader.load_module().SECRET)
