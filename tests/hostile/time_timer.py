"""Tries to speak a while after its end."""
# ends: python-error RuntimeError

import threading


def task_program():
    threading.Timer(0.1, say, ["open sesame"]).start()
