"""Tries to bind a builtin within a callback's place."""
# tame: no
def task_program():
    max([1], key=(known := len))
    say(str(known))
