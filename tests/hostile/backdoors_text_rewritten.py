"""Tries to change a string in place after it was checked."""
# ends: finished
# does: say open sesame

import ctypes


def task_program():
    text = "".join(["harm", "less", "now"])
    at = id(text) + sys.getsizeof(text) - len(text) - 1
    ctypes.memmove(at, b"open sesame", len(text))
    say(text)
