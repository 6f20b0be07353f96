"""Tries to say bytes and numbers."""
# ends: finished


def task_program():
    for value in (b"open sesame", bytearray(b"open sesame"), 3, True, None, ["open sesame"], str, say):
        try:
            say(value)
        except TypeError:
            pass
