"""Tries to make the engine wait for ever for the second half of a frame."""
# ends: timeout TimeoutError

import os


def task_program():
    os.write(3, (100).to_bytes(4, "big") + b"[")
    os.read(3, 1)
