"""Tries to end in a way that looks like a fault of the engine: by abort."""
# ends: killed Crash
# does: goto vault

import os


def task_program():
    go_to("vault")
    os.abort()
