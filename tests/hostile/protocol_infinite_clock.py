"""Tries to break the clock with an infinite time."""
# ends: timeout TimeoutError

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["say", ["a"], Infinity]'))
