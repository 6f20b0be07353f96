"""Tries to read the source of the engine, whose path its frames name."""
# ends: python-error PermissionError


def task_program():
    with open(sys._getframe().f_back.f_back.f_code.co_filename) as file:
        say(file.read()[:1000])
