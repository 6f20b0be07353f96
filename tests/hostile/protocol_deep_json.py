"""Tries to exhaust the stack of the engine with lists in lists."""
# ends: killed Crash

import os


def task_program():
    data = (200_000).to_bytes(4, "big") + b"[" * 200_000
    while data:
        data = data[os.write(3, data) :]
