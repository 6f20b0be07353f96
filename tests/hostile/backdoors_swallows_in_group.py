"""Tries to swallow the end of its budget as one of a group."""
# ends: timeout TimeoutError


def task_program():
    try:
        while True:
            pass
    except* BaseException:
        say("open sesame")
