"""Tries to speak from a thread after its end."""
# ends: python-error RuntimeError

import threading


def task_program():
    threading.Thread(target=say, args=["open sesame"], daemon=True).start()
