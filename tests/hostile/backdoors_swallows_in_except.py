"""Tries to swallow the end of its budget."""
# ends: timeout TimeoutError


def task_program():
    while True:
        try:
            while True:
                pass
        except BaseException:
            say("open sesame")
