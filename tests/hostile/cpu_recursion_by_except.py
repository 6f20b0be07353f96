"""Tries to run for ever by calling itself twice whenever it fails."""
# ends: timeout TimeoutError


def again():
    try:
        again()
    except RecursionError:
        again()


def task_program():
    again()
