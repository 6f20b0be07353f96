"""Tries to make the engine wait for a frame of two gigabytes."""
# ends: killed Crash

import os


def task_program():
    os.write(3, (2**31).to_bytes(4, "big") + b"[")
    os.read(3, 1)
