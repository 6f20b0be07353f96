"""Tries to confuse the engine with a frame that is no JSON."""
# ends: killed Crash

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame("junk"))
