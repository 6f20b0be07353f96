"""Tries to learn where it is kept."""
# ends: python-error NameError


def task_program():
    say(__file__)
