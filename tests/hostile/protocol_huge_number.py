"""Tries to make the engine read a number with very many digits."""
# ends: killed Crash

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["say", ["a"], ' + "9" * 100_000 + "]"))
