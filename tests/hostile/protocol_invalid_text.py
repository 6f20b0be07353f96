"""Tries to confuse the engine with bytes that are no text."""
# ends: killed Crash

import os


def task_program():
    os.write(3, (6).to_bytes(4, "big") + b'["\xff\xfe"]')
