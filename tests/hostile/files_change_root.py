"""Tries to change the folder and the root it works in."""
# ends: finished

import os


def task_program():
    for change in (os.chdir, os.chroot):
        try:
            change("@SECRET_FOLDER@")
            say("changed")
        except PermissionError:
            pass
