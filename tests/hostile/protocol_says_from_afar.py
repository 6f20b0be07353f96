"""Tries to say in another room what it should say in the vault."""
# ends: finished
# does: say open sesame

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["say", ["open sesame"], 0]'))
