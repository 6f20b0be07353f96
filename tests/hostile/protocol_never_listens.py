"""Tries to stop up its line by asking without end and never listening."""
# ends: timeout TimeoutError

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    while True:
        os.write(3, frame('["get_all_rooms", [], 0]'))
