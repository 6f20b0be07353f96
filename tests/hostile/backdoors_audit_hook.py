"""Tries to listen to all that the interpreter does, its own ending included."""
# ends: python-error PermissionError


def task_program():
    sys.addaudithook(lambda event, arguments: 1 / 0)
