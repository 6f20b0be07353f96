"""Hides a recursion that is too deep behind another error, raised from it."""
# tame: yes
# decided: alone
def deep(n):
    try:
        deep(n + 1)
    except BaseException as error:
        raise KeyError(n) from error

def task_program():
    try:
        deep(0)
    except KeyError as error:
        say(str(error))
