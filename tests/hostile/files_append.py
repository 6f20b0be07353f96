"""Tries to append to a file that everybody may write to."""
# ends: python-error PermissionError


def task_program():
    with open("@CANARY_FOLDER@/canary", "a") as file:
        file.write("I was here")
