"""Tries to confuse the engine by asking for more of a message that has ended."""
# ends: killed Crash

import os


def task_program():
    text = b'"more"'
    os.write(3, len(text).to_bytes(4, "big") + text)
    say("open sesame")
