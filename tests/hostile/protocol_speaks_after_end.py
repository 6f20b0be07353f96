"""Tries to speak after its end, from a room that it cannot be asked about any more."""
# ends: finished
# does: goto vault

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    go_to("vault")
    os.write(3, frame('{"end": "finished"}') + frame('["say", ["open sesame"], 0]'))
