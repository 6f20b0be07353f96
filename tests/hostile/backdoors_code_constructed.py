"""Tries to construct a code object by hand and to open a file in it."""
# ends: python-error PermissionError

import types


def opening():
    return open("@SECRET_FILE@").read()


def task_program():
    code = opening.__code__
    function = types.FunctionType(code.replace(co_filename="<frozen os>", co_name="opening"), {"open": open})
    say(function())
