"""Tries to be run again and again, by saying each time that it imports what is not there."""
# ends: killed Crash

import os


def task_program():
    text = b'{"end": "again"}'
    os.write(3, len(text).to_bytes(4, "big") + text)
    os.read(3, 4)
