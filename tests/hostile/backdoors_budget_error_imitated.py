"""Tries to catch the end of its budget by the name of its class."""
# ends: timeout TimeoutError


class BudgetSpentError(BaseException):
    pass


def task_program():
    try:
        while True:
            pass
    except BudgetSpentError:
        say("open sesame")
