"""Tries to call what the robot's class has besides skills."""
# ends: killed Crash

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["__init__", ["vault"], 0]'))
