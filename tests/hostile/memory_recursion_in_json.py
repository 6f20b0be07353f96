"""Tries to exhaust the stack where the engine packs what it says."""
# ends: python-error TypeError


def task_program():
    nested = []
    for _ in range(100_000):
        nested = [nested]
    say(nested)
