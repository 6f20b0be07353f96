"""Tries to forge what is said by replacing os.write."""
# ends: finished
# does: goto vault
# does: say harmless

import os


def task_program():
    write = os.write
    os.write = lambda descriptor, data: write(descriptor, bytes(data).replace(b"harmless", b"HARMLESS"))
    go_to("vault")
    say("harmless")
