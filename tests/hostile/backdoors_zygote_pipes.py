"""Tries to forge what the fork server reports, through the numbers its descriptors have there."""
# ends: finished

import os


def task_program():
    for descriptor in (4, 5, 6):
        for use in (lambda: os.write(descriptor, bytes(8)), lambda: os.read(descriptor, 8)):
            try:
                use()
                say("used")
            except PermissionError:
                pass
