"""Tries to pass a lie about why it ended."""
# ends: timeout TimeoutError

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('{"end": "timeout", "line": 1e400}'))
