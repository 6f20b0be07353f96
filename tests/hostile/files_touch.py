"""Tries to change the times and rights of a file, and goes on when that is refused."""
# ends: finished

import os


def task_program():
    for change in (
        lambda path: os.utime(path, (0, 0)),
        lambda path: os.chmod(path, 0),
        lambda path: os.chown(path, 0, 0),
        lambda path: os.setxattr(path, "user.mark", b"I was here"),
    ):
        try:
            change("@CANARY_FOLDER@/canary")
            say("changed")
        except PermissionError:
            pass
