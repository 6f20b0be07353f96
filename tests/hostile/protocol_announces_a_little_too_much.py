"""Tries to make the engine take a frame that is longer than any it sends."""
# ends: killed Crash

import os


def task_program():
    os.write(3, (1_000_001).to_bytes(4, "big"))
    os.read(3, 1)
