"""Tries to catch the end of its budget by the name of its class."""
# ends: timeout TimeoutError


class LimitReachedError(BaseException):
    pass


def task_program():
    try:
        while True:
            pass
    except LimitReachedError:
        say("open sesame")
