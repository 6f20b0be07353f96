"""Tries to tire the engine with a frame that comes in single bytes."""
# ends: finished
# does: say a

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    for byte in frame('["say", ["a"],' + " " * 1000 + "0]"):
        os.write(3, bytes([byte]))
