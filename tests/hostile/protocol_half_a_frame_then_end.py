"""Tries to end in the middle of a frame."""
# ends: killed Crash

import os


def task_program():
    os.write(3, (100).to_bytes(4, "big") + b"[")
