"""Tries to flood the trace with long texts."""
# ends: timeout TimeoutError
# does: 100 times say xxx...


def task_program():
    while True:
        say("x" * 10_000)
