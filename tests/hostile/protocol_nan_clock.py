"""Tries to stop the clock with a time that is no number."""
# ends: finished
# does: say a
# does: say b

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["say", ["a"], NaN]'))
    os.read(3, int.from_bytes(os.read(3, 4), "big"))
    say("b")
