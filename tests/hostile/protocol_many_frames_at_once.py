"""Tries to run ahead of the engine with many requests in one piece."""
# ends: finished

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["get_all_rooms", [], 0]') * 100)
