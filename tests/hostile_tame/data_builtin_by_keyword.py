"""Tries to get a builtin as a keyword argument of `dict`."""
# tame: no
def task_program():
    say(str(dict(key=len)))
