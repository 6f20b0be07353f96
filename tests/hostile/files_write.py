"""Tries to write a new file into a folder that everybody may write to."""
# ends: python-error PermissionError


def task_program():
    with open("@CANARY_FOLDER@/new", "w") as file:
        file.write("I was here")
