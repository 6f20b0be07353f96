"""Tries to pass an option whose flag is a number."""
# ends: killed Crash

import os


def frame(text):
    data = text.encode()
    return len(data).to_bytes(4, "big") + data


def task_program():
    os.write(3, frame('["ask", ["amy", "which", [["yes", 1]]], 0]'))
