"""Tries to pass by saying that it has finished."""
# ends: finished

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('{"end": "finished"}'))
