"""Tries to say a huge number."""
# ends: python-error ValueError


def task_program():
    say(str(1 << 100_000_000))
