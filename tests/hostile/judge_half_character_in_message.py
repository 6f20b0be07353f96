"""Tries to break whoever writes the outcome with half of a character in the message of its error."""
# ends: python-error ValueError


def task_program():
    raise ValueError("m\ud800")
