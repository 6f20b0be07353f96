"""Tries to exhaust the stack where the engine turns options into text."""
# ends: python-error RecursionError
# does: goto vault


def task_program():
    nested = []
    for _ in range(100_000):
        nested = [nested]
    go_to("vault")
    ask("amy", "which", [nested])
