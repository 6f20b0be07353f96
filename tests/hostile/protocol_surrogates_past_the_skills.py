"""Tries to put half characters into the trace."""
# ends: finished
# does: say open \ud800sesame

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["say", ["open \\ud800sesame"], 0]'))
    os.read(3, int.from_bytes(os.read(3, 4), "big"))
