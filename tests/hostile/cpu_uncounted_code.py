"""Tries to loop in code that it compiled itself, where nothing is counted, and to swallow what stops it."""
# ends: timeout TimeoutError


def task_program():
    while True:
        try:
            exec("while True: pass")
        except BaseException:
            pass
