"""Tries to read a secret file and say its content."""
# ends: python-error PermissionError


def task_program():
    with open("@SECRET_FILE@") as file:
        say(file.read())
