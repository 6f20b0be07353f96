"""Tries to outrun the limit of skill calls."""
# ends: timeout TimeoutError

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    while True:
        os.write(3, frame('["get_all_rooms", [], 0]'))
        os.read(3, int.from_bytes(os.read(3, 4), "big"))
