"""Tries to hear other replies by replacing os.read."""
# ends: finished
# does: goto vault
# does: say harmless

import os


def task_program():
    os.read = lambda descriptor, size: b""
    go_to("vault")
    say("harmless")
