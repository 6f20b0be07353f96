"""Tries to get a builtin out of an alternative."""
# tame: no
def task_program():
    say(str([str if True else 1][0]))
