"""Tries to return over the end of its budget."""
# ends: timeout TimeoutError


def swallow():
    try:
        while True:
            pass
    finally:
        return


def task_program():
    swallow()
    go_to("vault")
    say("open sesame")
